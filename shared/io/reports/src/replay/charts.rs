//! The drive from above and over time.

use kerbside_geometry::angle;

use super::data::ReplayReport;
use crate::svg::{Chart, Figure, Ink, Legend, Line, Map, Range, Span, Tone, Trace};
use crate::track::{Interpolator, over_time, positions};

const ODOMETRY: Line = Line::new(Ink::Orange);
const REFERENCE: Line = Line::new(Ink::Green).wide();

impl ReplayReport {
    pub(super) fn path_map(&self) -> Figure {
        let description = if self.reference.is_empty() {
            "Map of the path by odometry; there is no reference.".to_owned()
        } else {
            "Map of the path by odometry and of the reference.".to_owned()
        };
        let mut map = Map::new("map", "The drive from above", &description);
        if !self.reference.is_empty() {
            map.path(positions(&self.reference), REFERENCE);
            map.explain(Legend::line("reference", REFERENCE));
        }
        map.path(positions(&self.odometry), ODOMETRY);
        map.explain(Legend::line("odometry", ODOMETRY));
        let ends = [("start", self.odometry.first()), ("end", self.odometry.last())];
        for motion in ends.iter().filter_map(|(_, motion)| *motion) {
            map.arrow(motion.pose, Ink::Orange);
        }
        if let Some(last) = self.reference.last() {
            map.cross([last.pose.x, last.pose.y], Ink::Green);
        }
        map.figure().with_caption(
            "Arrow heads mark start and end of the odometry and point along the heading; the \
             cross is the end of the reference.",
        )
    }

    pub(super) fn motion_charts(&self) -> Vec<Figure> {
        let line = Line::new(Ink::Orange);
        let speed = Trace {
            label: String::new(),
            line,
            points: over_time(&self.odometry, |motion| motion.speed),
        };
        let speed = Chart {
            traces: vec![speed],
            description: "Speed of the rear-axle centre over time.".to_owned(),
            ..self.time_chart("speed", "Speed by odometry", "m/s", 0.1)
        };
        vec![self.travel_chart().figure(), speed.figure()]
    }

    fn travel_chart(&self) -> Chart {
        let trace = |travel: &super::WheelTravel| {
            let ink = [Ink::Blue, Ink::Orange, Ink::Green, Ink::Purple][travel.wheel.index()];
            let dashed = travel.wheel.is_left();
            let line = if dashed { Line::new(ink).dashed() } else { Line::new(ink) };
            let label = travel.wheel.name().to_owned();
            Trace { label, line, points: travel.points.clone() }
        };
        Chart {
            traces: self.travel.iter().map(trace).collect(),
            description: "Cumulative travel of each wheel over time.".to_owned(),
            ..self.time_chart("travel", "Travel per wheel", "m", 0.1)
        }
    }

    /// Odometry minus reference over time, in the reference's body frame where it has a heading.
    pub(super) fn error_charts(&self) -> Vec<Figure> {
        let (distance, heading) = self.errors();
        let distance = Chart {
            traces: vec![Trace {
                label: String::new(),
                line: Line::new(Ink::Blue),
                points: distance,
            }],
            description: "Distance between odometry and reference over time.".to_owned(),
            ..self.time_chart("drift-position", "Distance from the reference", "m", 0.02)
        };
        let has_heading = heading.iter().any(|point| point[1].is_finite());
        let heading = Chart {
            traces: vec![Trace {
                label: String::new(),
                line: Line::new(Ink::Purple),
                points: heading,
            }],
            description: "Heading of the odometry minus that of the reference over time."
                .to_owned(),
            ..self.time_chart("drift-heading", "Heading against the reference", "deg", 0.4)
        };
        let mut figures = vec![distance.figure()];
        figures.extend(has_heading.then(|| heading.figure()));
        figures
    }

    fn errors(&self) -> (Vec<[f64; 2]>, Vec<[f64; 2]>) {
        let mut odometry = Interpolator::new(&self.odometry);
        let mut turned = 0.0;
        let errors = self.reference.iter().filter_map(|reference| {
            let pose = odometry.at(reference.time)?;
            let heading = angle::unwrap(turned, pose.yaw - reference.pose.yaw);
            turned = if heading.is_finite() { heading } else { turned };
            let distance = pose.distance(&reference.pose);
            Some(([reference.time, distance], [reference.time, angle::degrees(heading)]))
        });
        errors.unzip()
    }

    fn time_chart(&self, id: &str, title: &str, unit: &str, least: f64) -> Chart {
        Chart {
            id: id.to_owned(),
            title: title.to_owned(),
            x_title: "time [s]".to_owned(),
            y_title: format!("[{unit}]"),
            x_range: self.time_range(),
            y_least: least,
            spans: self.gap_spans(),
            ..Chart::default()
        }
    }

    fn time_range(&self) -> Option<Range> {
        let odometry = self.odometry.iter().map(|motion| motion.time);
        let travel = self.travel.iter().flat_map(|travel| &travel.points).map(|point| point[0]);
        Range::covering(odometry.chain(travel))
    }

    fn gap_spans(&self) -> Vec<Span> {
        let span = |gap: &super::Gap| Span {
            from: gap.start,
            to: gap.end,
            label: "gap".to_owned(),
            tone: Tone::Bad,
        };
        self.gaps.iter().map(span).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::ReplayReport;
    use crate::{Motion, Provenance, replay::Model};
    use kerbside_geometry::Pose;

    fn motion(time: f64, x: f64, yaw: f64) -> Motion {
        Motion { time, pose: Pose::new(x, 0.0, yaw), speed: 0.0, steering: 0.0 }
    }

    #[test]
    fn errors_are_taken_at_the_reference_s_times() {
        let report = ReplayReport {
            input: String::new(),
            vehicle: String::new(),
            mode: String::new(),
            problem: None,
            caution: None,
            duration: 1.0,
            distance: 2.0,
            samples: 2,
            speed_factor: 1.0,
            odometry_sha256: String::new(),
            model: Model::default(),
            odometry: vec![motion(0.0, 0.0, 3.1), motion(1.0, 2.0, -3.1)],
            reference: vec![
                motion(0.5, 0.5, f64::NAN),
                motion(0.75, 1.0, -3.1),
                motion(2.0, 0.0, 0.0),
            ],
            drift: None,
            travel: Vec::new(),
            gaps: Vec::new(),
            refusals: Vec::new(),
            notes: Vec::new(),
            provenance: Provenance::default(),
        };
        let (distance, heading) = report.errors();
        assert_eq!(distance.len(), 2, "the third is beyond the odometry");
        assert!((distance[0][1] - 0.5).abs() < 1e-12 && (distance[1][1] - 0.5).abs() < 1e-12);
        assert!(heading[0][1].is_nan());
        assert!(heading[1][1].abs() < 2.0, "{} deg", heading[1][1]);
    }
}
