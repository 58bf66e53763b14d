//! Figures of rows 1 to 3.

use kerbside_calibration::{Noise, Settings, closed_form};
use kerbside_geometry::{Pose, angle, math};
use kerbside_proving_ground::{Manoeuvre, Pace, Reference};

use crate::calibrations::{Calibrations, Ends, Found};
use crate::figure::{Accept, Figure};
use crate::statistics::{bootstrap, mean, mean_between, number, rms, rms_between, share};
use crate::yard::Yard;

/// Places of the parameters.
const RADII: [usize; 4] = [0, 1, 2, 3];
const TRACKS: [usize; 2] = [4, 5];
const WHEELBASE: usize = 6;
const ZERO: usize = 7;
/// Paper's Table 1, in the order of the wheels, and its Table 2.
const DIAMETERS: [(&str, &str, f64); 4] = [
    ("fl", "141.94", 141.94),
    ("fr", "142.28", 142.28),
    ("rl", "139.03", 139.03),
    ("rr", "139.21", 139.21),
];

fn errors(all: &Calibrations, of: impl Fn(&Found) -> f64) -> Vec<f64> {
    all.found.iter().map(of).collect()
}

/// Share of errors within a limit, of several parameters together.
fn share_within(all: &Calibrations, parameters: &[usize], limit: f64) -> (f64, (f64, f64)) {
    let errors = all.found.iter().flat_map(|found| parameters.iter().map(|i| found.joint[*i]));
    let within = errors.filter(|error| error.abs() <= limit).count();
    share(within, all.found.len() * parameters.len())
}

fn within_figure(
    row: u8,
    name: &str,
    all: &Calibrations,
    parameters: &[usize],
    limit: f64,
) -> Figure {
    // The limits are three standard deviations; of normal errors 99.7 % lie within.
    let (ours, interval) = share_within(all, parameters, limit);
    Figure::new(row, name, "", ours, Accept::AtLeast(0.99)).between(interval)
}

/// Length of the mean end error of ten runs, averaged over the repetitions \[m\], and its interval.
fn mean_end(
    all: &Calibrations,
    (kind, axle): (usize, usize),
    of: fn(&Ends) -> &Vec<Pose>,
) -> (f64, (f64, f64)) {
    let lengths: Vec<f64> = all
        .found
        .iter()
        .map(|found| {
            let poses = of(&found.ends[kind][axle]);
            let along = |axis: fn(&Pose) -> f64| mean(poses.iter().map(axis));
            math::hypot(along(|pose| pose.x), along(|pose| pose.y))
        })
        .collect();
    mean_between(&lengths, 6)
}

/// Mean ends of ten runs of one kind (0 straights, 1 left circles) before and after, both axles.
fn end_figures(row: u8, all: &Calibrations, kind: usize, before: [f64; 2]) -> Vec<Figure> {
    let mut figures = Vec::new();
    for (axle, name) in ["rear", "front"].into_iter().enumerate() {
        let place = (kind, axle);
        let figure = |stage: &str, (ours, (low, high)): (f64, (f64, f64)), accept: Accept| {
            let name = format!("10-run mean end, {name}, {stage}");
            Figure::new(row, name, "mm", 1e3 * ours, accept).between((1e3 * low, 1e3 * high))
        };
        let expected = Accept::Within(0.9 * before[axle], 1.1 * before[axle]);
        let found = mean_end(all, place, |ends| &ends.before);
        figures.push(figure("before", found, expected));
        let found = mean_end(all, place, |ends| &ends.after);
        figures.push(figure("after", found, Accept::AtMost(20.0)));
        let found = mean_end(all, place, |ends| &ends.closed);
        figures.push(figure("after, closed form", found, Accept::Shown));
    }
    figures
}

/// Row 1: Table 1, Figure 6 (a) and (b).
pub(crate) fn straights(fine: &Calibrations, bent: &Calibrations) -> Vec<Figure> {
    let mut figures = Vec::new();
    for (i, (wheel, paper, truth)) in DIAMETERS.into_iter().enumerate() {
        let (mean, (low, high)) = mean_between(&errors(fine, |found| 2e3 * found.joint[i]), 1);
        let accept = Accept::Within(truth - 0.09, truth + 0.09);
        let figure = Figure::new(1, format!("diameter {wheel}, mean"), "mm", truth + mean, accept);
        figures.push(figure.between((truth + low, truth + high)).beside(paper));
    }
    for (left, axle, paper, truth) in [(0, "front", "-0.17", -0.17), (2, "rear", "-0.09", -0.09)] {
        let epsilons = errors(fine, |found| 1e3 * (found.joint[left] - found.joint[left + 1]));
        let (mean, (low, high)) = mean_between(&epsilons, 2);
        let accept = Accept::Within(truth - 0.036, truth + 0.036);
        let figure = Figure::new(1, format!("epsilon {axle}, mean"), "mm", truth + mean, accept);
        figures.push(figure.between((truth + low, truth + high)).beside(paper));
        let within = epsilons.iter().filter(|error| error.abs() <= 0.036).count();
        let (ours, interval) = share(within, epsilons.len());
        let name = format!("epsilon {axle}, share within 36 um");
        figures.push(Figure::new(1, name, "", ours, Accept::AtLeast(0.99)).between(interval));
    }
    figures.push(within_figure(1, "radii, share within 45 um", fine, &RADII, 45e-6));
    figures.extend(end_figures(1, fine, 0, [218.0, 141.0]));
    figures.extend(bound_figures(1, fine));
    figures.extend(bent_figures(bent));
    figures
}

/// With the steering's zero off by 0.2 degrees.
fn bent_figures(bent: &Calibrations) -> Vec<Figure> {
    let bias = |of: &dyn Fn(&Found) -> f64| {
        let errors = errors(bent, of);
        let (mean, (low, high)) = mean_between(&errors, 3);
        (1e6 * mean.abs(), (1e6 * low, 1e6 * high))
    };
    let (joint, interval) = bias(&|found| found.joint[2] - found.joint[3]);
    let joint = Figure::new(
        1,
        "epsilon rear bias, joint, zero 0.2 deg off",
        "um",
        joint,
        Accept::AtMost(15.0),
    )
    .between(interval);
    let (closed, interval) = bias(&|found| found.closed[2] - found.closed[3]);
    let closed = Figure::new(
        1,
        "epsilon rear bias, closed form, zero 0.2 deg off",
        "um",
        closed,
        Accept::Shown,
    );
    vec![joint, closed.between(interval)]
}

/// Root mean square errors over the Cramer-Rao bound, and coverage of the stated intervals.
fn bound_figures(row: u8, all: &Calibrations) -> Vec<Figure> {
    let identified = |i: &usize| all.bound[*i].is_finite();
    let ratio = |i: usize| rms(errors(all, |found| found.joint[i])) / all.bound[i];
    let worst = (0..8).filter(identified).map(ratio).fold(0.0, f64::max);
    let name = format!("worst rms over Cramer-Rao, {}", all.name);
    let worst = Figure::new(row, name, "", worst, Accept::AtMost(1.3))
        .between(rms_between(worst, all.found.len()));
    let covered = |found: &Found| {
        let inside = |i: &usize| found.joint[*i].abs() <= 1.96 * found.deviations[*i];
        (0..8).filter(identified).filter(inside).count()
    };
    let count = (0..8).filter(identified).count();
    let shares: Vec<f64> =
        errors(all, |found| f64::from(u32::try_from(covered(found)).unwrap_or(0)))
            .into_iter()
            .map(|inside| inside / f64::from(u32::try_from(count).unwrap_or(1)))
            .collect();
    let (ours, interval) = mean_between(&shares, 4);
    let name = format!("95 % intervals cover, {}", all.name);
    vec![worst, Figure::new(row, name, "", ours, Accept::Within(0.90, 0.99)).between(interval)]
}

/// Row 2: Table 2, Figure 6 (c) and (d).
pub(crate) fn arcs(fine: &Calibrations, wide: &Calibrations) -> Vec<Figure> {
    let mut figures = Vec::new();
    for (i, axle, paper, truth) in [(4, "front", "285", 285.0), (5, "rear", "292", 292.0)] {
        let (mean, (low, high)) = mean_between(&errors(fine, |found| 1e3 * found.joint[i]), 1);
        let accept = Accept::Within(truth - 0.8, truth + 0.8);
        let figure = Figure::new(2, format!("track {axle}, mean"), "mm", truth + mean, accept);
        figures.push(figure.between((truth + low, truth + high)).beside(paper));
    }
    figures.push(within_figure(2, "tracks, share within 0.8 mm", fine, &TRACKS, 0.8e-3));
    figures.push(within_figure(2, "wheelbase, share within 0.5 mm", fine, &[WHEELBASE], 0.5e-3));
    let hundredth = angle::radians(0.01);
    figures.push(within_figure(
        2,
        "steering zero, share within 0.01 deg",
        fine,
        &[ZERO],
        hundredth,
    ));
    figures.extend(end_figures(2, fine, 1, [251.0, 666.0]));
    let differences: Vec<f64> = fine
        .found
        .iter()
        .zip(&wide.found)
        .map(|(fine, wide)| 1e3 * (wide.joint[4] - fine.joint[4]))
        .collect();
    let (mean, interval) = mean_between(&differences, 5);
    let name = "front track, circles of 2.5 m less 1.5 m";
    figures.push(Figure::new(2, name, "mm", mean, Accept::Within(-1.0, 1.0)).between(interval));
    figures
}

/// Row 3: the same with the paper's reference.
pub(crate) fn coarse(all: &Calibrations) -> Vec<Figure> {
    let worst = |parameters: &[usize], scale: f64| {
        let sd = |i: &usize| scale * rms(errors(all, |found| found.joint[*i]));
        let worst = parameters.iter().map(sd).fold(0.0, f64::max);
        (worst, rms_between(worst, all.found.len()))
    };
    let (radius, interval) = worst(&RADII, 1e3);
    let radius =
        Figure::new(3, "radius, worst rms", "mm", radius, Accept::AtMost(0.40)).between(interval);
    let (track, interval) = worst(&TRACKS, 1e3);
    let track =
        Figure::new(3, "track, worst rms", "mm", track, Accept::AtMost(2.0)).between(interval);
    let bias = |i: usize| mean(errors(all, |found| found.joint[i])).abs() / all.bound[i];
    let worst = (0..8).map(bias).fold(0.0, f64::max);
    let spread = 1.96 / number(all.found.len()).sqrt();
    let bias = Figure::new(3, "worst bias over the bound's sd", "", worst, Accept::AtMost(1.0))
        .between((worst - spread, worst + spread));
    let mut figures = vec![radius, track, bias];
    figures.extend(bound_figures(3, all));
    figures.push(refusal());
    figures
}

/// A quarter of a circle under the paper's reference is refused by the closed form.
fn refusal() -> Figure {
    let yard = Yard::new(Reference::coarse(), 0.0);
    let (vehicle, settings): (_, Settings) = (yard.nominal(), yard.settings());
    let noise: Noise = settings.noise;
    let pace = Pace { speed: 0.25, acceleration: 0.1 };
    let quarter = Manoeuvre::arc(1.5, core::f64::consts::FRAC_PI_2, true, pace);
    let test = crate::scatter::drive(yard.physics, &yard.sensors, quarter);
    let runs = [yard.left_out(&test.record(1))];
    let refused = !closed_form(&runs, &vehicle, &noise).refused.is_empty();
    let ours = f64::from(u8::from(refused));
    Figure::new(3, "closed form refuses 90 deg arcs at 5 deg", "", ours, Accept::AtLeast(1.0))
}

/// Rows 1 and 2 with the physics on, shown beside.
pub(crate) fn physical(all: &Calibrations) -> Vec<Figure> {
    let bias = |name: &str, row: u8, i: usize, scale: f64, unit: &'static str| {
        let (mean, interval) = mean_between(&errors(all, |found| scale * found.joint[i]), 7);
        Figure::new(row, format!("{name} error with physics"), unit, mean, Accept::Shown)
            .between(interval)
    };
    let mut figures = vec![
        bias("radius fl", 1, 0, 1e6, "um"),
        bias("radius rl", 1, 2, 1e6, "um"),
        bias("track front", 2, 4, 1e3, "mm"),
        bias("track rear", 2, 5, 1e3, "mm"),
    ];
    for (kind, row) in [(0, 1), (1, 2)] {
        for (axle, name) in ["rear", "front"].into_iter().enumerate() {
            let (ours, (low, high)) = mean_end(all, (kind, axle), |ends| &ends.after);
            let name = format!("10-run mean end with physics, {name}, after");
            figures.push(
                Figure::new(row, name, "mm", 1e3 * ours, Accept::Shown)
                    .between((1e3 * low, 1e3 * high)),
            );
        }
    }
    let inflation: Vec<f64> = errors(all, |found| found.inflation);
    let of = |indices: &[usize]| mean(indices.iter().map(|i| inflation[*i]));
    let interval = bootstrap(inflation.len(), 8, of);
    let ours = mean(inflation.iter().copied());
    let name = "residuals' mean square with physics";
    figures.push(Figure::new(1, name, "", ours, Accept::Shown).between(interval));
    figures
}
