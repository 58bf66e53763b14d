//! The manoeuvre from above, and its end from near.

use kerbside_geometry::Pose;

use super::data::{EstimateSample, ParkReport, Plan};
use super::errors::ellipse;
use crate::Motion;
use crate::format;
use crate::svg::{Area, Figure, Ink, Legend, Line, Map, Range};
use crate::track::{outline, positions, segments, spaced};

pub(super) const PLAN: Line = Line::new(Ink::Blue).dashed();
pub(super) const ESTIMATE: Line = Line::new(Ink::Orange);
pub(super) const TRUTH: Line = Line::new(Ink::Green).wide();

/// Outlines drawn along the path.
const OUTLINES: usize = 40;

impl ParkReport {
    pub(super) fn scene_map(&self) -> Figure {
        let mut map = Map::new("map", "The manoeuvre from above", &self.describe_scene());
        self.frame(&mut map);
        self.draw_ground(&mut map);
        self.draw_vehicle(&mut map);
        self.draw_paths(&mut map);
        self.draw_gear_changes(&mut map);
        self.draw_names(&mut map);
        self.explain(&mut map);
        map.figure().with_caption(
            "Outlines follow the driven path. Numbers mark changes of the travel direction, arrow \
             heads the direction of travel.",
        )
    }

    fn describe_scene(&self) -> String {
        format!(
            "Map of scenario {}: obstacles, slot, planned, estimated and {} path, {}.",
            self.scenario,
            if self.truth.is_empty() { "no true" } else { "true" },
            format::plural(u64::from(self.figures.gear_changes), "gear change", "gear changes"),
        )
    }

    /// Shows the bounds and whatever lies at start, goal or on the way; obstacles may reach far
    /// beyond.
    fn frame(&self, map: &mut Map) {
        let [x0, y0, x1, y1] = self.scene.bounds;
        let mut points = vec![[x0, y0], [x1, y1]];
        points.extend(self.scene.slot.iter().copied());
        for pose in [self.scene.start, self.scene.goal] {
            points.extend(outline(&self.scene.footprint, &pose));
        }
        points.extend(positions(&self.driven()));
        let range = |axis: usize| {
            let covered = Range::covering(points.iter().map(|point| point[axis]));
            covered.unwrap_or(Range::new(0.0, 1.0))
        };
        let (x, y) = (range(0), range(1));
        let pad = 0.03 * x.span().max(y.span());
        map.show(x.at_least(x.span() + 2.0 * pad), y.at_least(y.span() + 2.0 * pad));
    }

    fn draw_ground(&self, map: &mut Map) {
        let [x0, y0, x1, y1] = self.scene.bounds;
        map.polygon(&[[x0, y0], [x1, y0], [x1, y1], [x0, y1]], Area::Free);
        for obstacle in &self.scene.obstacles {
            map.polygon(obstacle, Area::Obstacle);
        }
        map.polygon(&self.scene.slot, Area::Place);
    }

    fn draw_vehicle(&self, map: &mut Map) {
        let footprint = &self.scene.footprint;
        let driven = self.driven();
        for pose in spaced(&driven, 0.3 * footprint.length, OUTLINES) {
            map.polygon(&outline(footprint, &pose), Area::Trail(Ink::Grey));
        }
        map.polygon(&outline(footprint, &self.scene.start), Area::Outline(Ink::Text));
        if let Some(last) = driven.last() {
            map.polygon(&outline(footprint, &last.pose), Area::Solid(Ink::Green));
        }
        map.polygon(&outline(footprint, &self.scene.goal), Area::Outline(Ink::Text));
    }

    /// Names stand beside the path, not on it.
    fn draw_names(&self, map: &mut Map) {
        let footprint = &self.scene.footprint;
        let middle = 0.5 * footprint.length - footprint.rear_overhang;
        for (pose, name) in [(self.scene.start, "start"), (self.scene.goal, "goal")] {
            let (x, y) = pose.transform(middle, 0.27 * footprint.width);
            map.label([x, y], name);
        }
    }

    fn draw_paths(&self, map: &mut Map) {
        map.path(positions(&self.truth), TRUTH);
        map.path(positions(&self.estimated()), ESTIMATE);
        for plan in &self.plans {
            map.path(positions(&plan.points), PLAN);
            for (first, last) in segments(&plan.points) {
                map.arrow(direction_of_travel(&plan.points[first..=last]), Ink::Blue);
            }
        }
    }

    /// Those of a plan that another one replaced were driven only up to there.
    fn draw_gear_changes(&self, map: &mut Map) {
        let begin = |plan: &Plan| plan.points.first().map(|point| point.time);
        let mut number = 0;
        for (index, plan) in self.plans.iter().enumerate() {
            let end = self.plans.get(index + 1).and_then(begin).unwrap_or(f64::INFINITY);
            for pair in segments(&plan.points).windows(2) {
                let cusp = plan.points[pair[1].0];
                if cusp.time < end {
                    number += 1;
                    map.number([cusp.pose.x, cusp.pose.y], number, Ink::Blue);
                }
            }
        }
    }

    fn explain(&self, map: &mut Map) {
        let entries = [
            (!self.truth.is_empty(), Legend::line("truth", TRUTH)),
            (!self.estimate.is_empty(), Legend::line("estimate", ESTIMATE)),
            (!self.plans.is_empty(), Legend::line("plan", PLAN)),
            (!self.driven().is_empty(), Legend::area("final pose", Area::Solid(Ink::Green))),
            (true, Legend::area("start and goal", Area::Outline(Ink::Text))),
            (!self.scene.slot.is_empty(), Legend::area("slot", Area::Place)),
            (!self.scene.obstacles.is_empty(), Legend::area("obstacle", Area::Obstacle)),
        ];
        for (_, entry) in entries.into_iter().filter(|(is_shown, _)| *is_shown) {
            map.explain(entry);
        }
    }

    /// The end of the true and of the estimated path in the goal frame, in millimetres.
    pub(super) fn end_map(&self) -> Figure {
        let title = "The end pose, seen from the goal";
        let mut map = Map::small("end", title, &self.describe_end(), "mm");
        let [x, y] = [self.scene.tolerance.x, self.scene.tolerance.y].map(|length| 1e3 * length);
        map.polygon(&[[-x, -y], [x, -y], [x, y], [-x, y]], Area::Place);
        map.explain(Legend::area("tolerance", Area::Place));
        map.cross([0.0, 0.0], Ink::Text);
        let seen = |pose: &Pose| in_millimetres(&pose.seen_from(&self.scene.goal));
        let estimate = self.estimate.last().map(|last| (seen(&last.motion.pose), last));
        let truth = self.truth.last().map(|last| seen(&last.pose));
        let ends = [estimate.map(|(end, _)| end), truth];
        let lengths = ends.iter().flatten().flat_map(|end| [end.x.abs(), end.y.abs()]);
        let farthest = lengths.fold(x.max(y), f64::max);
        if let Some((end, last)) = estimate {
            self.draw_ellipse(&mut map, &end, last);
            draw_end(&mut map, "estimate", ESTIMATE, end, farthest);
        }
        if let Some(end) = truth {
            draw_end(&mut map, "truth", TRUTH, end, farthest);
        }
        let range = Range::new(-1.25 * farthest, 1.25 * farthest);
        map.show(range, range);
        map.figure().with_caption(
            "The goal is the cross, its heading points right. Arrow heads sit at the rear-axle \
             centre and point along the heading.",
        )
    }

    fn draw_ellipse(&self, map: &mut Map, end: &Pose, last: &EstimateSample) {
        let corners = ellipse(&last.covariance, self.scene.goal.yaw, 2.0);
        let about_end = |[x, y]: &[f64; 2]| [end.x + 1e3 * x, end.y + 1e3 * y];
        let corners: Vec<_> = corners.iter().map(about_end).collect();
        map.polygon(&corners, Area::Trail(Ink::Orange));
        map.explain(Legend::area("2 sigma of the estimate", Area::Trail(Ink::Orange)));
    }

    fn describe_end(&self) -> String {
        let Some(end) = self.figures.end_error.or(self.figures.estimate_error) else {
            return "The end pose in the goal frame is not known.".to_owned();
        };
        format!(
            "The vehicle ended {} along, {} across and {} from the goal.",
            format::millimetres(end.x),
            format::millimetres(end.y),
            format::degrees(end.yaw),
        )
    }

    /// The true path, or the estimated one where there is no truth.
    pub(super) fn driven(&self) -> Vec<Motion> {
        if self.truth.is_empty() { self.estimated() } else { self.truth.clone() }
    }

    pub(super) fn estimated(&self) -> Vec<Motion> {
        self.estimate.iter().map(|sample| sample.motion).collect()
    }
}

fn in_millimetres(pose: &Pose) -> Pose {
    Pose::new(1e3 * pose.x, 1e3 * pose.y, pose.yaw)
}

/// A pose as an arrow head and a line along its heading, on a map that reaches `farthest`.
fn draw_end(map: &mut Map, name: &str, line: Line, end: Pose, farthest: f64) {
    let (x, y) = end.transform(0.4 * farthest, 0.0);
    map.path(vec![[end.x, end.y], [x, y]], line);
    map.arrow(end, line.ink);
    map.explain(Legend::line(name, line));
}

/// Half-way along a stretch, turned to where it goes.
fn direction_of_travel(stretch: &[Motion]) -> Pose {
    let middle = stretch[stretch.len() / 2];
    let turn = if middle.speed < 0.0 { core::f64::consts::PI } else { 0.0 };
    Pose { yaw: middle.pose.yaw + turn, ..middle.pose }
}
