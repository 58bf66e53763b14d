//! The paper's figures, drawn from what came out.

use kerbside_geometry::Pose;
use kerbside_reproduction::{
    Calibrations, Contender, Ends, Growth, Knowledge, LENGTHS, Parkings, RunEnds,
};

use super::tables::mean_length;
use crate::format;
use crate::svg::{Chart, Figure, Ink, Legend, Line, Map, Ticks, Trace};

/// Points of a path that are drawn: every so many readings.
const STRIDE: usize = 8;

fn ink(contender: Contender) -> Ink {
    match contender {
        Contender::Rear => Ink::Orange,
        Contender::Front => Ink::Sky,
        Contender::PaperOwn => Ink::Vermilion,
        Contender::Paper => Ink::Purple,
        Contender::FusedBlind => Ink::Grey,
        Contender::Fused => Ink::Blue,
    }
}

fn points(path: &[Pose]) -> Vec<[f64; 2]> {
    path.iter().step_by(STRIDE).chain(path.last()).map(|pose| [pose.x, pose.y]).collect()
}

/// Figure 6: ends of ten runs that no fit has seen, before and after.
pub(super) fn figure_6(fine: &Calibrations) -> Vec<Figure> {
    let Some(first) = fine.found.first() else { return Vec::new() };
    let mut figures = Vec::new();
    for (kind, name) in ["straights of 5 m", "left circles of 1.5 m"].into_iter().enumerate() {
        for (axle, place) in ["rear", "front"].into_iter().enumerate() {
            let ends = &first.ends[kind][axle];
            figures.push(end_map(
                &format!("figure-6-{kind}-{axle}"),
                &format!("{place}, {name}"),
                ends,
            ));
        }
    }
    figures
}

fn end_map(id: &str, title: &str, ends: &RunEnds) -> Figure {
    let description =
        "End points of dead reckoning against the true end, before and after calibration.";
    let mut map = Map::small(id, title, description, "mm");
    for (poses, ink, label) in
        [(&ends.before, Ink::Orange, "before"), (&ends.after, Ink::Blue, "after")]
    {
        poses.iter().for_each(|pose| map.cross([1e3 * pose.x, 1e3 * pose.y], ink));
        map.explain(Legend::line(label, Line::new(ink)));
    }
    map.label([0.0, 0.0], "true end");
    let length = |poses: &[Pose]| format::fixed(1e3 * mean_length(poses), 0);
    map.figure().with_caption(format!(
        "Mean of the ten ends: {} mm before, {} mm after.",
        length(&ends.before),
        length(&ends.after)
    ))
}

/// The drives that Figures 7 to 9 are drawn from: equal noise, residual errors.
fn drawn(ends: &[Ends]) -> impl Iterator<Item = &Ends> {
    ends.iter().filter(|ends| ends.case == 1 && ends.knowledge == Knowledge::Residual)
}

/// Figure 7: one drive at each speed.
pub(super) fn figure_7(ends: &[Ends]) -> Vec<Figure> {
    let map = |ends: &Ends| {
        let speed = format::fixed(1e3 * ends.speed, 0);
        let mut map = Map::small(
            &format!("figure-7-{speed}"),
            &format!("Paths at {speed} mm/s"),
            "True path, and the path by each filter, of one drive.",
            "m",
        );
        let truth = Line::new(Ink::Green).wide();
        map.path(points(&ends.truth), truth);
        map.explain(Legend::line("truth", truth));
        for contender in [Contender::Rear, Contender::Paper, Contender::Fused] {
            if let Some(spread) = ends.of(contender) {
                let line = Line::new(ink(contender));
                map.path(points(&spread.path), line);
                map.explain(Legend::line(contender.name(), line));
            }
        }
        map.figure()
    };
    drawn(ends).map(map).collect()
}

/// Figure 8: the error along the path, of that one drive and of all.
pub(super) fn figure_8(ends: &[Ends]) -> Vec<Figure> {
    let Some(ends) = drawn(ends).next() else { return Vec::new() };
    let shown = [Contender::Rear, Contender::Paper, Contender::Fused];
    let single = shown.into_iter().filter_map(|contender| {
        let path = &ends.of(contender)?.path;
        let zipped = ends.times.iter().zip(&ends.truth).zip(path).step_by(STRIDE);
        let points = zipped.map(|((time, truth), pose)| [*time, 1e3 * pose.distance(truth)]);
        let line = Line::new(ink(contender));
        Some(Trace { label: contender.name().to_owned(), line, points: points.collect() })
    });
    let all = shown.into_iter().filter_map(|contender| {
        let spread = ends.of(contender)?;
        let rms = |errors: &Vec<[f64; 3]>| {
            #[allow(clippy::cast_precision_loss)] // drives
            let count = errors.len() as f64;
            let square: f64 = errors.iter().map(|[x, y, _]| x * x + y * y).sum();
            1e3 * (square / count).sqrt()
        };
        let stations = ends.stations.iter().zip(&spread.errors);
        let points = stations.map(|(station, errors)| [*station, rms(errors)]).collect();
        Some(Trace { label: contender.name().to_owned(), line: Line::new(ink(contender)), points })
    });
    let chart = |id: &str, title: &str, x_title: &str, traces: Vec<Trace>| Chart {
        id: id.to_owned(),
        title: title.to_owned(),
        description: title.to_owned(),
        x_title: x_title.to_owned(),
        y_title: "[mm]".to_owned(),
        traces,
        ..Chart::default()
    };
    vec![
        chart("figure-8-one", "Position error of one drive", "time [s]", single.collect()).figure(),
        chart("figure-8-all", "Root mean square over all drives", "path [m]", all.collect())
            .figure(),
    ]
}

/// Figure 9: ends of all drives.
pub(super) fn figure_9(ends: &[Ends]) -> Vec<Figure> {
    let slow = |case: &&Ends| case.speed < 0.1 && case.knowledge == Knowledge::Residual;
    let map = |case: &Ends| {
        let name = kerbside_reproduction::NOISE_CASES[case.case].1;
        let description =
            "End errors of all drives by rear wheels, by the paper's filter and fused.";
        let mut map = Map::small(&format!("figure-9-{}", case.case), name, description, "mm");
        for contender in [Contender::Rear, Contender::Paper, Contender::Fused] {
            if let Some(spread) = case.of(contender) {
                let ink = ink(contender);
                spread.end().iter().for_each(|[x, y, _]| map.cross([1e3 * x, 1e3 * y], ink));
                map.explain(Legend::line(contender.name(), Line::new(ink)));
            }
        }
        let ratio = |contender| format::fixed(case.variance_ratio(contender, Contender::Rear).0, 2);
        map.figure().with_caption(format!(
            "Variance over rear: the paper 0.66; paper (ii) {}, fused {}.",
            ratio(Contender::Paper),
            ratio(Contender::Fused)
        ))
    };
    ends.iter().filter(slow).map(map).collect()
}

/// NEES over the distance.
pub(super) fn growth(rows: &[Growth]) -> Vec<Figure> {
    let Some(row) = rows.first() else { return Vec::new() };
    let traces = row.spreads.iter().map(|spread| Trace {
        label: spread.contender.name().to_owned(),
        line: Line::new(ink(spread.contender)),
        points: LENGTHS
            .into_iter()
            .zip(row.nees(spread.contender))
            .map(|(length, (nees, _))| [length, nees])
            .collect(),
    });
    let chart = Chart {
        id: "growth".to_owned(),
        title: "NEES/3 on a straight".to_owned(),
        description: "Normalised squared error over the distance; 1 where the covariance is true."
            .to_owned(),
        x_title: "distance [m]".to_owned(),
        y_title: "NEES/3".to_owned(),
        y_ticks: Ticks::Log,
        limits: vec![1.0],
        traces: traces.collect(),
        ..Chart::default()
    };
    vec![chart.figure()]
}

/// Figure 10: the given paths, and the first parking of those who park by the fused filter.
pub(super) fn figure_10(lines: &[Parkings]) -> Vec<Figure> {
    use kerbside_reproduction::Driver;
    let map = |line: &Parkings| {
        let name = line.scene.name();
        let description = "The plan and the true path of the first parking.";
        let mut map = Map::small(&format!("figure-10-{name}"), name, description, "m");
        let (plan, driven) = (Line::new(Ink::Green).wide(), Line::new(Ink::Blue));
        map.path(points(&line.plan), plan);
        map.path(points(&line.path), driven);
        map.explain(Legend::line("plan", plan));
        map.explain(Legend::line("driven", driven));
        if let Some(goal) = line.plan.last() {
            map.arrow(*goal, Ink::Green);
        }
        map.figure()
    };
    lines.iter().filter(|line| line.driver == Driver::Fused).map(map).collect()
}
