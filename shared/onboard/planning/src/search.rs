//! The search for a path: a tree of arcs and lines that grows backwards from the goal, and from
//! every pose of it an attempt to get there from the start in closed form.
//!
//! Nodes are poses at which the car stands. They are opened in the order of what a plan through
//! them costs at least (A*), after the hybrid A* of Dolgov, Thrun, Montemerlo and Diebel (2010):
//! poses are exact, a grid only decides which of two nodes that are nearly the same is kept. The
//! tree grows from the goal because the goal is the narrow end. Where a grid leaves no node and no
//! path, a finer one is tried.

use kerbside_geometry::{Pose, angle};

use crate::bound::Bound;
use crate::connect::{self, Link};
use crate::cost::Cost;
use crate::problem::Problem;
use crate::segment::{Piece, Segment, gear_changes};
use crate::sweep::Sweep;
use crate::tree::{Node, Resolution, Tree};

/// Lengths of the arcs tried from a node, in steps.
const LENGTHS: [u8; 14] = [1, 2, 3, 4, 5, 6, 8, 10, 13, 17, 22, 29, 38, 50];
/// Their curvatures, in shares of the greatest.
const CURVATURES: [f64; 5] = [0.0, 1.0, -1.0, 0.5, -0.5];
/// Directions of travel and curvatures.
const UNITS: usize = 2 * CURVATURES.len();
/// Halvings by which the farthest pose that is still clear is found.
const HALVINGS: u32 = 4;
/// Nodes between two signs of progress.
const REPORT: u32 = 32;
/// Grids, each half as wide as the one before.
const GRIDS: i32 = 4;

/// A path that was found.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    /// From start to goal.
    pub(crate) pieces: Vec<Piece>,
    /// Nodes opened.
    pub(crate) nodes: u32,
}

/// The search's end without one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NotFound {
    /// Nodes opened.
    pub(crate) nodes: u32,
    /// No node of the finest grid was left.
    pub(crate) exhausted: bool,
}

/// Finds a path, or says that it found none; `progress` is told the nodes opened so far.
pub(crate) fn find(problem: &Problem, progress: &mut dyn FnMut(u32)) -> Result<Found, NotFound> {
    let all = problem.search_nodes;
    let [comfortable, needed] = problem.attempts;
    let plain = (0..GRIDS).map(|grid| Attempt { clearance: needed, grid, nodes: all });
    let first = Attempt { clearance: comfortable, grid: 0, nodes: all / 4 };
    let first = (comfortable > needed).then_some(first);
    let mut nodes = 0;
    for attempt in first.into_iter().chain(plain) {
        let mut search = Search::new(problem, attempt, nodes, progress);
        search.run();
        nodes = search.opened;
        if let Some(pieces) = search.path() {
            return Ok(Found { pieces, nodes });
        }
        if nodes >= all {
            return Err(NotFound { nodes, exhausted: false });
        }
    }
    Err(NotFound { nodes, exhausted: true })
}

/// What one run of the search is to keep to.
#[derive(Clone, Copy, Debug)]
struct Attempt {
    /// Least clearance of the path \[m\].
    clearance: f64,
    /// How often the grid is halved.
    grid: i32,
    /// Nodes to open, those of earlier attempts included.
    nodes: u32,
}

/// What comes between a piece and the node it leads to.
#[derive(Clone, Copy, Debug)]
struct Joint {
    cost: f64,
    gear_changes: u32,
}

/// A direction of travel and a curvature that are tried from every node.
#[derive(Clone, Copy, Debug)]
struct Unit {
    /// One metre of it.
    piece: Piece,
    /// Time to bring the steering there from straight ahead \[s\].
    first: f64,
}

impl Unit {
    fn all(cost: &Cost, curvature: f64) -> [Self; UNITS] {
        core::array::from_fn(|index| {
            let gear = if index < CURVATURES.len() { 1.0 } else { -1.0 };
            let piece = Piece::new(gear, CURVATURES[index % CURVATURES.len()] * curvature);
            Self { piece, first: cost.first(&piece) }
        })
    }
}

struct Search<'a> {
    problem: &'a Problem,
    attempt: Attempt,
    cost: Cost,
    bound: Bound,
    units: [Unit; UNITS],
    step: f64,
    tree: Tree,
    links: Vec<Link>,
    opened: u32,
    progress: &'a mut dyn FnMut(u32),
    best: Option<(f64, u32, Link)>,
}

impl<'a> Search<'a> {
    fn new(
        problem: &'a Problem,
        attempt: Attempt,
        opened: u32,
        progress: &'a mut dyn FnMut(u32),
    ) -> Self {
        let resolution = Resolution::halved(problem.wheelbase, attempt.grid);
        let mut tree = Tree::new(resolution);
        let goal = Node { pose: problem.goal, cost: 0.0, next: None, gear_changes: 0 };
        tree.push(goal, 0.0, 0.0);
        let cost = Cost::new(problem.pace, problem.wheelbase, problem.curvature);
        Self {
            problem,
            attempt,
            cost,
            units: Unit::all(&cost, problem.curvature),
            bound: Bound::new(problem.pace, problem.start, problem.curvature),
            step: resolution.step,
            tree,
            links: Vec::new(),
            opened,
            progress,
            best: None,
        }
    }

    /// Opens nodes until none is left that could lead to something better, or too many were.
    fn run(&mut self) {
        (self.progress)(self.opened);
        while self.opened < self.attempt.nodes {
            let Some((index, node)) = self.tree.pop(self.best_cost()) else { break };
            self.opened += 1;
            if self.opened.is_multiple_of(REPORT) {
                (self.progress)(self.opened);
            }
            self.connect(index, &node);
            self.grow(index, &node);
        }
        (self.progress)(self.opened);
    }

    fn best_cost(&self) -> f64 {
        self.best.map_or(f64::INFINITY, |(cost, ..)| cost)
    }

    fn path(&self) -> Option<Vec<Piece>> {
        let (_, index, link) = self.best?;
        Some(link.pieces().iter().copied().chain(self.tree.way_from(index)).collect())
    }

    /// A lower bound of the cost from the start to a pose.
    fn estimate(&self, pose: &Pose) -> f64 {
        let start = &self.problem.start;
        let turn = angle::wrap(pose.yaw - start.yaw).abs() / self.problem.curvature;
        self.cost.at_least(pose.distance(start).max(turn))
    }

    /// What comes between a piece and a node; none where the gears forbid it.
    fn joint(&self, node: &Node, piece: &Piece) -> Option<Joint> {
        let Some((_, next)) = &node.next else {
            let arrives = self.problem.gear == 0 || self.problem.gear == piece.gear();
            return arrives.then_some(Joint { cost: 0.0, gear_changes: 0 });
        };
        let change = u32::from(next.gear() != piece.gear());
        (node.gear_changes + change <= self.problem.gear_changes)
            .then(|| Joint { cost: self.cost.joint(piece, next), gear_changes: change })
    }

    /// Adds what leads to a node and may become better than the best.
    fn grow(&mut self, index: u32, node: &Node) {
        let (place, units) = (self.bound.place(&node.pose), self.units);
        for unit in &units {
            // Going on is what longer arcs are for; going back along the same arc is idle.
            let bend = unit.piece.curvature;
            #[allow(clippy::float_cmp)] // both are products of the same two numbers
            let same = node.next.is_some_and(|(_, next)| next.curvature == bend);
            let Some(joint) = self.joint(node, &unit.piece).filter(|_| !same) else { continue };
            let least = node.cost + joint.cost + self.bound.time_before(&place, bend, unit.first);
            if least < self.best_cost() {
                self.grow_along(index, node, unit, joint);
            }
        }
    }

    /// The poses along one arc that leads to a node, as far as it is clear.
    fn grow_along(&mut self, index: u32, node: &Node, unit: &Unit, joint: Joint) {
        let lengths = LENGTHS.map(|steps| f64::from(steps) * self.step);
        let bend = unit.piece.curvature.abs();
        let most = lengths.partition_point(|length| length * bend <= core::f64::consts::PI);
        let clear = self.clear_lengths(&node.pose, unit.piece, &lengths[..most]);
        for length in &lengths[..clear] {
            self.push_along(index, node, unit, *length, joint);
        }
        if clear < most {
            let reached = reached(&lengths, clear);
            let farthest = self.farthest(&node.pose, unit.piece, reached, lengths[clear]);
            if farthest > reached + 0.1 * self.step {
                self.push_along(index, node, unit, farthest, joint);
            }
        }
    }

    /// How many of the lengths are clear. What is clear is so from the node on, so halving tells.
    fn clear_lengths(&self, end: &Pose, unit: Piece, lengths: &[f64]) -> usize {
        let (mut clear, mut blocked) = (0, lengths.len() + 1);
        let mut tried = lengths.len();
        while blocked - clear > 1 {
            if self.is_clear(end, unit, reached(lengths, clear), lengths[tried - 1]) {
                clear = tried;
            } else {
                blocked = tried;
            }
            tried = usize::midpoint(clear, blocked);
        }
        clear
    }

    fn push_along(&mut self, index: u32, node: &Node, unit: &Unit, length: f64, joint: Joint) {
        let piece = Piece::new(length * unit.piece.length, unit.piece.curvature);
        let before = Node {
            pose: piece.start_before(&node.pose),
            cost: node.cost + joint.cost + self.cost.piece(&piece, node.next.is_none()),
            next: Some((index, piece)),
            gear_changes: node.gear_changes + joint.gear_changes,
        };
        let place = self.bound.place(&before.pose);
        let least = before.cost + self.bound.time(&place, piece.curvature, unit.first);
        if least < self.best_cost() {
            let estimate = before.cost + self.estimate(&before.pose);
            self.tree.push(before, estimate, least);
        }
    }

    /// Whether the arc that ends at `end` is clear between two distances from there.
    fn is_clear(&self, end: &Pose, unit: Piece, near: f64, far: f64) -> bool {
        let from = Piece::new(near * unit.length, unit.curvature).start_before(end);
        let back = Piece::new((near - far) * unit.length, unit.curvature);
        self.clears(&Segment::new(from, back))
    }

    /// Whether a segment is clear whose start is.
    fn clears(&self, segment: &Segment) -> bool {
        let sweep = Sweep::new(&self.problem.footprint, segment);
        sweep.stays_clear(&self.problem.world, self.attempt.clearance)
    }

    /// The farthest clear distance between one that is and one that is not.
    fn farthest(&self, end: &Pose, unit: Piece, mut clear: f64, mut blocked: f64) -> f64 {
        for _ in 0..HALVINGS {
            let half = 0.5 * (clear + blocked);
            if self.is_clear(end, unit, clear, half) {
                clear = half;
            } else {
                blocked = half;
            }
        }
        clear
    }

    /// Ways from the start to a node in closed form; the best of all is kept.
    fn connect(&mut self, index: u32, node: &Node) {
        let mut links = core::mem::take(&mut self.links);
        links.clear();
        connect::links(&self.problem.start, &node.pose, self.problem.curvature, &mut links);
        for link in &links {
            let Some(cost) = self.link_cost(node, link) else { continue };
            if cost < self.best_cost() && self.link_is_clear(link, node.pose) {
                self.best = Some((cost, index, *link));
            }
        }
        self.links = links;
    }

    /// Cost of the whole plan over a link; none where the gears forbid it or it is far too long.
    fn link_cost(&self, node: &Node, link: &Link) -> Option<f64> {
        let pieces = link.pieces();
        let Some(last) = pieces.last() else {
            let first = node.next.map_or(0.0, |(_, piece)| self.cost.first(&piece));
            return Some(node.cost + first);
        };
        let length: f64 = pieces.iter().map(|piece| piece.length.abs()).sum();
        if node.cost + self.cost.at_least(length) >= self.best_cost() {
            return None;
        }
        let joint = self.joint(node, last)?;
        let changes = gear_changes(pieces.iter().map(Piece::gear)) + joint.gear_changes;
        if node.gear_changes + changes > self.problem.gear_changes {
            return None;
        }
        let between: f64 = pieces.windows(2).map(|pair| self.cost.joint(&pair[0], &pair[1])).sum();
        let ends = |index: usize| node.next.is_none() && index + 1 == pieces.len();
        let each = pieces.iter().enumerate().map(|(i, piece)| self.cost.piece(piece, ends(i)));
        Some(node.cost + joint.cost + between + each.sum::<f64>() + self.cost.first(&pieces[0]))
    }

    /// Whether a link to `end` is clear, judged from there: that is where it is narrow.
    fn link_is_clear(&self, link: &Link, mut end: Pose) -> bool {
        link.pieces().iter().rev().all(|piece| {
            let back = Segment::new(end, Piece::new(-piece.length, piece.curvature));
            end = back.end();
            self.clears(&back)
        })
    }
}

/// The last of so many lengths.
fn reached(lengths: &[f64], count: usize) -> f64 {
    count.checked_sub(1).map_or(0.0, |last| lengths[last])
}
