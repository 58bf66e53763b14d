//! The paper's calibration: radii from straight runs, tracks from arcs, by sums over whole runs.
//!
//! Straight, equations (7) to (12): (10) put into (12) says that each wheel rolls the run's length S, so R = S/sum of
//! its rotation, and epsilon = left minus right radius. Arc, equation (13): b = (R_r sum Da - R_l sum Db)/theta. Both
//! are exact for any curvature on the way. The front wheels' increments are turned by their own wheel angles first
//! (form b), which depend on the front track a little: the sum is iterated. Averages of epsilon over
//! samples instead of sums would be biased by the counts' variance; that a straight run is straight is assumed, and an
//! error of the steering zero goes into epsilon in full: both are what the joint fit is for.

use kerbside_geometry::Vehicle;

use crate::error::CalibrationError;
use crate::joint::Rejected;
use crate::measured::{Kind, Measured, front_along, kind, length, rotation, turn};
use crate::noise::Noise;
use crate::parameters::{COUNT, Parameter, Parameters};
use crate::run::Run;

/// Largest uncertainty of an arc's turn over its turn.
const COARSE: f64 = 0.03;
/// Rounds after which the front track stands still.
const ROUNDS: usize = 20;

/// Result of the closed form.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedForm {
    /// Radii and tracks; what is not identified, and wheelbase, zero and gain, are nominal.
    pub parameters: Parameters,
    /// Which parameters it identified.
    pub identified: [bool; COUNT],
    /// Runs that gave the radii.
    pub straights: Vec<String>,
    /// Runs that gave the tracks.
    pub arcs: Vec<String>,
    /// Arcs that were refused, and why.
    pub refused: Vec<Rejected>,
    /// What is missing for a whole calibration.
    pub missing: Vec<CalibrationError>,
}

/// Radii and tracks from `runs`; what they do not hold stays nominal and is named in `missing`.
#[must_use]
pub fn closed_form(runs: &[Run], vehicle: &Vehicle, noise: &Noise) -> ClosedForm {
    let mut form = ClosedForm {
        parameters: Parameters::nominal(vehicle),
        identified: [false; COUNT],
        straights: Vec::new(),
        arcs: Vec::new(),
        refused: Vec::new(),
        missing: Vec::new(),
    };
    let nominal = form.parameters;
    let of_kind = |wanted| runs.iter().filter(move |run| kind(run, vehicle, &nominal) == wanted);
    let straights: Vec<(&Run, Measured)> = of_kind(Kind::Straight)
        .filter_map(|run| Some((run, length(run, vehicle, noise)?)))
        .filter(|(_, length)| length.value > 0.0)
        .collect();
    form.radii(&straights);
    let arcs: Vec<(&Run, Measured)> = of_kind(Kind::Arc)
        .filter_map(|run| Some((run, turn(run, vehicle, &form.parameters, noise)?)))
        .filter(|(_, turn)| turn.value != 0.0)
        .collect();
    let known = arcs.is_empty();
    let arcs = form.without_coarse(arcs);
    form.tracks(&arcs, vehicle);
    if form.straights.is_empty() {
        form.missing.push(CalibrationError::NoStraight);
    }
    if known {
        form.missing.push(CalibrationError::NoArc);
    }
    form
}

impl ClosedForm {
    /// Each wheel rolls the length of the straights: equations (10) and (12).
    fn radii(&mut self, straights: &[(&Run, Measured)]) {
        self.straights = straights.iter().map(|(run, _)| run.name.clone()).collect();
        for wheel in 0..4 {
            let (mut rolled, mut turned) = (0.0, 0.0);
            for (run, length) in straights.iter().filter(|(run, _)| run.wheels()[wheel]) {
                rolled += length.value;
                turned += rotation(run, wheel, length.from, length.to).abs();
            }
            if turned > 0.0 {
                self.parameters.values[wheel] = rolled / turned;
                self.identified[wheel] = true;
            }
        }
    }

    /// Arcs whose turn is known to 3 % or better; the others are refused by name.
    fn without_coarse<'a>(&mut self, arcs: Vec<(&'a Run, Measured)>) -> Vec<(&'a Run, Measured)> {
        let share = |turn: &Measured| (turn.deviation / turn.value).abs();
        let best = arcs.iter().min_by(|(_, a), (_, b)| share(a).total_cmp(&share(b))).copied();
        let (fine, coarse): (Vec<_>, Vec<_>) =
            arcs.into_iter().partition(|(_, turn)| share(turn) <= COARSE);
        let refusal = |(run, turn): &(&Run, Measured)| CalibrationError::CoarseHeading {
            run: run.name.clone(),
            share: 100.0 * share(turn),
        };
        self.refused = coarse
            .iter()
            .map(|arc| Rejected { run: arc.0.name.clone(), why: refusal(arc).to_string() })
            .collect();
        if fine.is_empty() {
            self.missing.extend(best.as_ref().map(refusal));
        }
        fine
    }

    /// Equation (13), headings averaged before they are divided by.
    fn tracks(&mut self, arcs: &[(&Run, Measured)], vehicle: &Vehicle) {
        self.arcs = arcs.iter().map(|(run, _)| run.name.clone()).collect();
        let p = self.parameters;
        let rear = pooled(arcs, |run, arc| {
            let wheels = run.wheels();
            let travel = |wheel: usize| p.values[wheel] * rotation(run, wheel, arc.from, arc.to);
            (wheels[2] && wheels[3]).then(|| travel(3) - travel(2))
        });
        if let Some(track) = rear.filter(|_| vehicle.track_rear > 0.0) {
            self.parameters.set(Parameter::TrackRear, track);
            self.identified[Parameter::TrackRear.index()] = !self.straights.is_empty();
        }
        let mut track = vehicle.track_front;
        for _ in 0..ROUNDS {
            let front = pooled(arcs, |run, arc| {
                let along = |wheel| front_along(run, wheel, &p, track, (arc.from, arc.to));
                Some(along(1)? - along(0)?)
            });
            let Some(next) = front.filter(|_| vehicle.track_front > 0.0) else { return };
            track = next;
        }
        self.parameters.set(Parameter::TrackFront, track);
        self.identified[Parameter::TrackFront.index()] = !self.straights.is_empty();
    }
}

/// Sum of differences over sum of turns, both taken along each arc's own side.
fn pooled(
    arcs: &[(&Run, Measured)],
    difference: impl Fn(&Run, &Measured) -> Option<f64>,
) -> Option<f64> {
    let (mut above, mut below) = (0.0, 0.0);
    for (run, arc) in arcs {
        if let Some(difference) = difference(run, arc) {
            above += difference * arc.value.signum();
            below += arc.value.abs();
        }
    }
    (below > 0.0 && above > 0.0).then(|| above / below)
}
