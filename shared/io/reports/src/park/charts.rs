//! The manoeuvre over time.

use kerbside_geometry::angle;

use super::data::{CommandSample, EventKind, Latency, ParkReport};
use super::errors::{EstimateError, estimate_errors};
use super::scene::{ESTIMATE, PLAN, TRUTH};
use crate::svg::{
    Band, Chart, Figure, Ink, Line, Mark, Range, Span, Ticks, Tone, Trace, latency_histogram,
    latency_tail,
};
use crate::track::over_time;
use crate::{Motion, format};

const COMMAND: Line = Line::new(Ink::Purple);
/// 95 of 100 are below it: chi-square with three degrees of freedom.
const CHI_SQUARE: f64 = 7.815;
/// Lower end of the chart of the normalised error: an error this small says no more than a smaller one.
const LEAST_NEES: f64 = 0.01;
/// Neighbouring samples further apart than this are not joined by a line \[s\].
const HOLE: f64 = 0.5;

impl ParkReport {
    pub(super) fn motion_charts(&self) -> Vec<Figure> {
        let speed = self.motion_chart("speed", "Speed", "m/s", 0.1, |motion| motion.speed);
        let steering = self.motion_chart("steering", "Steering angle", "deg", 4.0, |motion| {
            angle::degrees(motion.steering)
        });
        let commanded = |figure: fn(&CommandSample) -> f64| self.commanded("command", figure);
        let speed = with_trace(speed, commanded(|command| command.speed));
        let steering = with_trace(steering, commanded(|command| angle::degrees(command.steering)));
        vec![speed.figure(), steering.figure()]
    }

    /// Plan and truth of a figure of the motion; the estimate where there is no truth.
    fn motion_chart(
        &self,
        id: &str,
        title: &str,
        unit: &str,
        least: f64,
        figure: impl Fn(&Motion) -> f64,
    ) -> Chart {
        let (name, line) =
            if self.truth.is_empty() { ("estimate", ESTIMATE) } else { ("truth", TRUTH) };
        let mut chart = self.time_chart(id, title, unit, least);
        chart.description = format!("{title} over time: planned, commanded and driven.");
        chart.traces = vec![
            trace(name, line, over_time(&self.driven(), &figure)),
            trace("plan", PLAN, self.planned(&figure)),
        ];
        chart
    }

    fn planned(&self, figure: impl Fn(&Motion) -> f64) -> Vec<[f64; 2]> {
        let plans = self.plans.iter().map(|plan| over_time(&plan.points, &figure));
        // A plan that was cut short by the next one ends where that begins: time never runs back in
        // a trace.
        let mut points: Vec<[f64; 2]> = Vec::new();
        for plan in plans {
            let begin = plan.first().map_or(f64::INFINITY, |point| point[0]);
            points.retain(|point| point[0] < begin);
            points.extend(plan);
        }
        points
    }

    fn commanded(&self, label: &str, figure: fn(&CommandSample) -> f64) -> Trace {
        let points = self.commands.iter().map(|command| [command.time, figure(command)]);
        trace(label, COMMAND, points.collect())
    }

    pub(super) fn tracking_charts(&self) -> Vec<Figure> {
        let millimetres = |label: &str, line, figure: fn(&CommandSample) -> f64| Trace {
            line,
            ..self.commanded(label, figure)
        };
        let position = Chart {
            description: "Errors of position that the tracker saw, over time.".to_owned(),
            traces: vec![
                millimetres("along", Line::new(Ink::Blue), |command| 1e3 * command.error_along),
                millimetres("across", Line::new(Ink::Vermilion), |command| {
                    1e3 * command.error_across
                }),
            ],
            ..self.time_chart("tracking-position", "Tracking error, position", "mm", 4.0)
        };
        let heading = Chart {
            description: "Error of heading that the tracker saw, over time.".to_owned(),
            traces: vec![millimetres("heading", Line::new(Ink::Purple), |command| {
                angle::degrees(command.error_yaw)
            })],
            ..self.time_chart("tracking-heading", "Tracking error, heading", "deg", 0.4)
        };
        vec![position.figure(), heading.figure()]
    }

    pub(super) fn estimate_charts(&self) -> Vec<Figure> {
        let errors = estimate_errors(self);
        let millimetres: fn(f64) -> f64 = |metres| 1e3 * metres;
        let charts = [
            ("estimate-along", "Estimate error, along", "mm", 4.0, 0, millimetres, Ink::Blue),
            (
                "estimate-across",
                "Estimate error, across",
                "mm",
                4.0,
                1,
                millimetres,
                Ink::Vermilion,
            ),
            (
                "estimate-heading",
                "Estimate error, heading",
                "deg",
                0.4,
                2,
                angle::degrees,
                Ink::Purple,
            ),
        ];
        let draw = |(id, title, unit, least, axis, shown, ink)| {
            let chart = self.time_chart(id, title, unit, least);
            error_chart(chart, &errors, axis, shown, ink).figure()
        };
        let mut figures = charts.map(draw).to_vec();
        figures.push(self.consistency_chart(&errors).figure());
        figures
    }

    fn consistency_chart(&self, errors: &[EstimateError]) -> Chart {
        let shown = errors.iter().map(|error| error.normalised).filter(|value| value.is_finite());
        let range = Range::new(LEAST_NEES, shown.fold(10.0 * CHI_SQUARE, f64::max) * 2.0);
        let point = |error: &EstimateError| [error.time, error.normalised.max(LEAST_NEES)];
        let points = errors.iter().map(point).collect();
        let title = "Normalised error squared (NEES)";
        Chart {
            description:
                "Error squared in units of its covariance, over time, with its 95 % limit; \
                          logarithmic."
                    .to_owned(),
            traces: vec![trace("error in units of its covariance", Line::new(Ink::Text), points)],
            limits: vec![CHI_SQUARE],
            y_ticks: Ticks::Log,
            y_range: Some(range),
            y_title: "[-], dashed: 95 % limit".to_owned(),
            ..self.time_chart("consistency", title, "-", 2.0)
        }
    }

    fn time_chart(&self, id: &str, title: &str, unit: &str, least: f64) -> Chart {
        Chart {
            id: id.to_owned(),
            title: title.to_owned(),
            x_title: "time [s]".to_owned(),
            y_title: format!("[{unit}]"),
            x_range: self.time_range(),
            y_least: least,
            spans: self.spans(),
            marks: self.marks(),
            ..Chart::default()
        }
    }

    /// One range for all charts, so that they can be compared at a glance.
    fn time_range(&self) -> Option<Range> {
        let truth = self.truth.iter().map(|motion| motion.time);
        let estimate = self.estimate.iter().map(|sample| sample.motion.time);
        let commands = self.commands.iter().map(|command| command.time);
        let phases = self.phases.iter().flat_map(|phase| [phase.start, phase.end]);
        Range::covering(truth.chain(estimate).chain(commands).chain(phases))
    }

    fn spans(&self) -> Vec<Span> {
        let span = |phase: &super::Phase| Span {
            from: phase.start,
            to: phase.end,
            label: phase.mode.clone(),
            tone: phase.tone,
        };
        self.phases.iter().map(span).collect()
    }

    /// Faults and restarts; the table of events says what they were.
    fn marks(&self) -> Vec<Mark> {
        let mark = |event: &super::Event| {
            let tone = match event.kind {
                EventKind::Fault => Tone::Bad,
                EventKind::Restart => Tone::Warn,
                _ => return None,
            };
            Some(Mark { x: event.time, label: String::new(), tone })
        };
        self.events.iter().filter_map(mark).collect()
    }
}

fn with_trace(mut chart: Chart, trace: Trace) -> Chart {
    chart.traces.push(trace);
    chart
}

fn error_chart(
    chart: Chart,
    errors: &[EstimateError],
    axis: usize,
    shown: fn(f64) -> f64,
    ink: Ink,
) -> Chart {
    let band = errors.iter().map(|error| {
        let width = 2.0 * shown(error.deviation[axis]);
        [error.time, -width, width]
    });
    let points = errors.iter().map(|error| [error.time, shown(error.error[axis])]).collect();
    Chart {
        description: format!(
            "{} over time, with its band of two standard deviations.",
            chart.title
        ),
        traces: vec![trace("estimate minus truth", Line::new(ink), points)],
        bands: vec![Band { label: "2 sigma".to_owned(), ink, points: band.collect() }],
        ..chart
    }
}

/// A trace with a hole wherever samples stayed away.
fn trace(label: &str, line: Line, points: Vec<[f64; 2]>) -> Trace {
    let mut whole = Vec::with_capacity(points.len());
    for point in points {
        let is_after_hole = whole.last().is_some_and(|last: &[f64; 2]| point[0] - last[0] > HOLE);
        if is_after_hole {
            whole.push([f64::NAN; 2]);
        }
        whole.push(point);
    }
    Trace { label: label.to_owned(), line, points: whole }
}

pub(super) fn latency_figures(latency: &Latency) -> Vec<Figure> {
    vec![
        latency_histogram("latency-histogram", "How often", &latency.counts, quantiles(latency)),
        latency_tail("latency-tail", "The tail", &latency.counts, deadline(latency)),
    ]
}

fn quantiles(latency: &Latency) -> Vec<Mark> {
    let named =
        [("p50", latency.p50), ("p99", latency.p99), ("p99.9", latency.p999), ("max", latency.max)];
    let mark = |(name, time): (&str, f64)| Mark {
        x: time,
        label: format!("{name} {}", format::duration(time)),
        tone: Tone::Plain,
    };
    named.into_iter().map(mark).collect()
}

fn deadline(latency: &Latency) -> Vec<Mark> {
    let mark = |time| Mark {
        x: time,
        label: format!("deadline {}", format::duration(time)),
        tone: Tone::Bad,
    };
    latency.deadline.into_iter().map(mark).collect()
}
