//! The map: along the driven path, where the vehicle went astray and which way.

use kerbside_diagnosis::{MapPoint, RunPaths};
use kerbside_geometry::{Pose, math};

use super::data::{DiagnoseReport, points};
use crate::svg::{Figure, Ink, Legend, Line, Map, Range};

/// Colours of the residual over its floor: from which on, and what that is called.
const STEPS: [(f64, Ink, &str); 4] = [
    (0.0, Ink::Grey, "within the floor"),
    (1.0, Ink::Sky, "up to 2 floors"),
    (2.0, Ink::Orange, "up to 5 floors"),
    (5.0, Ink::Vermilion, "more"),
];
/// Points of all runs that are drawn, about.
const DRAWN: usize = 6000;
/// Arrows begin here: less is noise.
const ASTRAY: f64 = 2.0;
/// Arrows keep this share of the map's size from one another.
const APART: f64 = 0.06;
/// Height of the map, in figure units: the chain and the map fit one screen.
const TALLEST: f64 = 330.0;
/// Points farther apart than this share of the map's size belong to no common line.
const HOLE: f64 = 0.25;

fn step_of(point: &MapPoint) -> usize {
    STEPS.iter().rposition(|(from, _, _)| point.excess >= *from).unwrap_or(0)
}

impl DiagnoseReport {
    /// The map; none without a place that is known.
    pub(super) fn map(&self) -> Option<Figure> {
        let runs = &self.diagnosis.paths;
        let all = || runs.iter().flat_map(|run| &run.map);
        let x = Range::covering(all().map(|point| point.x))?;
        let y = Range::covering(all().map(|point| point.y))?;
        let size = x.span().max(y.span()).max(1e-3);
        let title = "Where along the way";
        let description = "The driven paths from above, coloured by the residual over its noise floor; \
                           arrows point to where the vehicle went astray.";
        let mut map = Map::new("map", title, description);
        map.show(x.at_least(0.2 * size).padded(0.05), y.at_least(0.2 * size).padded(0.05));
        map.keep_within(TALLEST);
        for run in runs {
            if run.map.is_empty() {
                map.path(points(&run.measured), Line::new(Ink::Grey).thin());
            }
        }
        let every = all().count().div_ceil(DRAWN).max(1);
        let thin = |run: &RunPaths| run.map.iter().step_by(every).copied().collect::<Vec<_>>();
        let ways: Vec<Vec<MapPoint>> = runs.iter().map(thin).collect();
        // What is worst lies on top.
        for (step, (_, ink, _)) in STEPS.iter().enumerate() {
            for way in &ways {
                let line = pieces(way, step, HOLE * size);
                map.path(line.clone(), Line::new(*ink).wide());
                map.path(line, Line::new(*ink));
            }
        }
        for arrow in arrows(all(), APART * size) {
            map.arrow(arrow, Ink::Text);
        }
        for (_, ink, words) in STEPS {
            map.explain(Legend::line(words, Line::new(ink).wide()));
        }
        let caption =
            "An arrow points to where the vehicle went astray from what the link before explains.";
        Some(map.figure().with_caption(caption))
    }
}

/// The stretches of a run of one colour, a hole between any two.
fn pieces(run: &[MapPoint], step: usize, hole: f64) -> Vec<[f64; 2]> {
    let mut line = Vec::new();
    for pair in run.windows(2) {
        let apart = math::hypot(pair[1].x - pair[0].x, pair[1].y - pair[0].y) > hole;
        if step_of(&pair[1]) == step && !apart {
            line.extend([[pair[0].x, pair[0].y], [pair[1].x, pair[1].y]]);
        } else {
            line.push([f64::NAN, f64::NAN]);
        }
    }
    line
}

/// Arrows at the places that are worst in their surroundings.
fn arrows<'a>(points: impl Iterator<Item = &'a MapPoint>, apart: f64) -> Vec<Pose> {
    let is_drawn = |point: &&MapPoint| {
        let whole = [point.x, point.y, point.direction].iter().all(|value| value.is_finite());
        whole && point.excess >= ASTRAY
    };
    let mut worst: Vec<&MapPoint> = points.filter(is_drawn).collect();
    worst.sort_by(|a, b| b.excess.total_cmp(&a.excess));
    let mut arrows: Vec<Pose> = Vec::new();
    for point in worst {
        let near = |arrow: &Pose| math::hypot(arrow.x - point.x, arrow.y - point.y) < apart;
        if !arrows.iter().any(near) {
            arrows.push(Pose::new(point.x, point.y, point.direction));
        }
    }
    arrows
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, excess: f64) -> MapPoint {
        MapPoint { x, y: 0.0, excess, direction: 1.0 }
    }

    #[test]
    fn each_stretch_has_one_colour() {
        let run = [0.5, 0.9, 1.5, 3.0, 7.0, 0.1].map(|excess| point(excess, excess));
        let drawn = |step| pieces(&run, step, 1e9).iter().filter(|p| p[0].is_finite()).count() / 2;
        assert_eq!([0, 1, 2, 3].map(drawn), [2, 1, 1, 1]);
        assert_eq!(step_of(&point(0.0, f64::NAN)), 0);
    }

    #[test]
    fn a_jump_is_not_bridged() {
        let run = [point(0.0, 0.0), point(5.0, 0.0), point(5.1, 0.0)];
        let line = pieces(&run, 0, 1.0);
        assert_eq!(line.iter().filter(|p| p[0].is_finite()).count(), 2);
    }

    #[test]
    fn arrows_stand_apart_and_at_the_worst() {
        let points: Vec<_> =
            (0..100_u8).map(|i| point(0.01 * f64::from(i), 1.0 + f64::from(i))).collect();
        let arrows = arrows(points.iter(), 0.25);
        assert_eq!(arrows[0].x, 0.99);
        assert!(arrows.len() >= 3 && arrows.windows(2).all(|pair| pair[0].x - pair[1].x >= 0.25));
    }
}
