//! The tree of a search: its nodes, the order in which they are opened, and the grid that tells
//! which are nearly the same.

use std::collections::{BinaryHeap, HashMap};
use std::hash::{BuildHasherDefault, Hasher};

use kerbside_geometry::{Pose, angle};

use crate::segment::Piece;

/// How fine a search is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Resolution {
    /// Step along arcs \[m\].
    pub(crate) step: f64,
    /// Side of the grid's cells \[m\], and their part of the heading \[rad\].
    cell: f64,
    cell_yaw: f64,
}

impl Resolution {
    /// A tenth of the wheelbase and 4 degrees, halved so many times.
    pub(crate) fn halved(wheelbase: f64, times: i32) -> Self {
        let share = 0.5_f64.powi(times);
        let length = 0.1 * wheelbase * share;
        Self { step: length, cell: length, cell_yaw: angle::radians(4.0) * share }
    }
}

/// A pose at which the car stands, with the way from there to the goal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub(crate) pose: Pose,
    /// From here to the goal.
    pub(crate) cost: f64,
    /// The next node towards the goal and the way to it; none at the goal.
    pub(crate) next: Option<(u32, Piece)>,
    /// From here to the goal.
    pub(crate) gear_changes: u32,
}

/// An open node, ordered so that a heap yields the least estimate first, the oldest of equals.
#[derive(Clone, Copy, Debug)]
struct Open {
    estimate: f64,
    least: f64,
    node: u32,
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> core::cmp::Ordering {
        other.estimate.total_cmp(&self.estimate).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<core::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Open {}

/// Nodes nearly the same: position, heading, gear changes and gear.
type Cell = (i32, i32, i32, u32, i8);
/// Never iterated over, and without a random seed.
type Cells = HashMap<Cell, f64, BuildHasherDefault<Mixed>>;

/// A hash of the few small numbers of a cell, which nobody chooses to collide: each is multiplied in.
#[derive(Clone, Copy, Debug, Default)]
struct Mixed(u64);

impl Mixed {
    fn mix(&mut self, word: u64) {
        // The golden ratio's fraction; the turn brings what was carried upwards down again.
        self.0 = (self.0.rotate_left(26) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
}

impl Hasher for Mixed {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.mix(u64::from(*byte)));
    }

    fn write_i32(&mut self, number: i32) {
        self.mix(u64::from(number.cast_unsigned()));
    }

    fn write_u32(&mut self, number: u32) {
        self.mix(u64::from(number));
    }

    fn write_i8(&mut self, number: i8) {
        self.mix(u64::from(number.cast_unsigned()));
    }

    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 32)
    }
}

/// Nodes, open and closed.
pub(crate) struct Tree {
    resolution: Resolution,
    nodes: Vec<Node>,
    open: BinaryHeap<Open>,
    cells: Cells,
}

impl Tree {
    pub(crate) fn new(resolution: Resolution) -> Self {
        let (nodes, open, cells) = (Vec::new(), BinaryHeap::new(), Cells::default());
        Self { resolution, nodes, open, cells }
    }

    /// Keeps a node unless one nearly the same costs no more. It is opened in the order of `estimate`; a plan through
    /// it costs no less than `least`.
    pub(crate) fn push(&mut self, node: Node, estimate: f64, least: f64) {
        let cell = self.cell(&node);
        if self.cells.get(&cell).is_some_and(|cost| *cost <= node.cost) {
            return;
        }
        let Ok(index) = u32::try_from(self.nodes.len()) else { return };
        self.cells.insert(cell, node.cost);
        self.nodes.push(node);
        self.open.push(Open { estimate, least, node: index });
    }

    /// The open node of the least estimate that may lead below `limit`, which is then open no more.
    pub(crate) fn pop(&mut self, limit: f64) -> Option<(u32, Node)> {
        loop {
            let Open { estimate, least, node: index } = self.open.pop()?;
            if estimate >= limit {
                return None;
            }
            if least >= limit {
                continue;
            }
            let node = self.nodes[index as usize];
            if self.cells.get(&self.cell(&node)).is_none_or(|cost| node.cost <= *cost) {
                return Some((index, node));
            }
        }
    }

    /// The pieces from a node to the goal.
    pub(crate) fn way_from(&self, index: u32) -> impl Iterator<Item = Piece> {
        let mut next = self.nodes[index as usize].next;
        core::iter::from_fn(move || {
            let (index, piece) = next?;
            next = self.nodes[index as usize].next;
            Some(piece)
        })
    }

    #[allow(clippy::cast_possible_truncation)] // `as` saturates: far out, nodes share a cell
    fn cell(&self, node: &Node) -> Cell {
        let Resolution { cell, cell_yaw, .. } = self.resolution;
        let Pose { x, y, yaw } = node.pose;
        let number = |value: f64, size: f64| (value / size).round() as i32;
        let yaw = number(angle::wrap(yaw), cell_yaw);
        let gear = node.next.map_or(0, |(_, piece)| piece.gear());
        (number(x, cell), number(y, cell), yaw, node.gear_changes, gear)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(x: f64, cost: f64, next: Option<(u32, Piece)>) -> Node {
        Node { pose: Pose::new(x, 0.0, 0.0), cost, next, gear_changes: 0 }
    }

    #[test]
    fn the_cheapest_of_a_cell_is_opened_and_only_below_the_limit() {
        let mut tree = Tree::new(Resolution::halved(1.0, 0));
        let piece = Piece::new(0.5, 0.2);
        let push = |tree: &mut Tree, node: Node, estimate| tree.push(node, estimate, estimate);
        push(&mut tree, node(0.0, 0.0, None), 0.0);
        push(&mut tree, node(1.00, 5.0, Some((0, piece))), 6.0);
        push(&mut tree, node(1.01, 4.0, Some((0, piece))), 5.0);
        push(&mut tree, node(1.02, 4.5, Some((0, piece))), 5.5);
        push(&mut tree, node(3.0, 1.0, Some((2, piece))), 9.0);
        let order: Vec<f64> =
            core::iter::from_fn(|| tree.pop(8.0)).map(|(_, node)| node.pose.x).collect();
        assert_eq!(order, [0.0, 1.01]);
        assert_eq!(tree.way_from(3).count(), 2);
    }
}
