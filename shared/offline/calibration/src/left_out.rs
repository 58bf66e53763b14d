//! Runs left out of a fit, and how far dead reckoning by that fit ends from their truth.

use kerbside_geometry::Vehicle;

use crate::condense::Condensed;
use crate::error::CalibrationError;
use crate::joint::joint_fit;
use crate::noise::Settings;
use crate::parameters::Parameters;
use crate::path::{EndError, Source, end_error, floor, reckon};

/// End errors of a run that was left out of the fit that corrects it.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// The run.
    pub run: String,
    /// Its manoeuvre.
    pub manoeuvre: String,
    /// What was reckoned from.
    pub source: Source,
    /// By the nominal vehicle.
    pub before: EndError,
    /// By the other runs' fit.
    pub after: EndError,
    /// Deviation that the known start and end alone put into the position \[m\].
    pub floor_position: f64,
    /// And into the heading \[rad\].
    pub floor_yaw: f64,
}

/// Refits `runs` with each of `folds` parts left out, and judges the fit on that part. `manoeuvres` are the runs'.
pub(crate) fn left_out(
    runs: &[&Condensed],
    manoeuvres: &[String],
    vehicle: &Vehicle,
    fitted: &Parameters,
    settings: &Settings,
) -> Result<Vec<LeftOut>, CalibrationError> {
    let folds = settings.folds.min(runs.len());
    let mut table = Vec::new();
    if folds < 2 {
        return Ok(table);
    }
    let fold = fold_of(manoeuvres, folds);
    let nominal = Parameters::nominal(vehicle);
    for out in 0..folds {
        let is_out = |index: &usize| fold[*index] == out;
        let rest: Vec<&Condensed> =
            (0..runs.len()).filter(|index| !is_out(index)).map(|index| runs[index]).collect();
        if rest.is_empty() {
            continue;
        }
        let fit = joint_fit(&rest, vehicle, fitted, settings)?;
        for index in (0..runs.len()).filter(is_out) {
            let run = runs[index];
            for source in [Source::Rear, Source::Front, Source::All] {
                let error = |parameters: &Parameters| {
                    end_error(run, parameters, &reckon(run, parameters, settings, source)?)
                };
                let (floor_position, floor_yaw) = floor(run, settings);
                if let (Some(before), Some(after)) = (error(&nominal), error(&fit.parameters)) {
                    let manoeuvre = manoeuvres[index].clone();
                    let run = run.name.clone();
                    table.push(LeftOut {
                        run,
                        manoeuvre,
                        source,
                        before,
                        after,
                        floor_position,
                        floor_yaw,
                    });
                }
            }
        }
    }
    table.sort_by(|a, b| (&a.run, a.source).cmp(&(&b.run, b.source)));
    Ok(table)
}

/// The part each run belongs to: run after run, those of one manoeuvre after one another, are dealt out in turn, so
/// that parts are as large as one another and hold something of every manoeuvre there is enough of.
#[must_use]
pub fn fold_of(manoeuvres: &[String], folds: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..manoeuvres.len()).collect();
    order.sort_by_key(|index| &manoeuvres[*index]);
    let mut fold = vec![0; order.len()];
    for (place, index) in order.into_iter().enumerate() {
        fold[index] = place % folds.max(1);
    }
    fold
}

#[cfg(test)]
mod tests {
    use super::fold_of;

    #[test]
    fn parts_are_even_whatever_is_driven() {
        let named = |names: &[&str]| names.iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(fold_of(&named(&["straight", "eight", "slalom", "steps"]), 3), [0, 0, 1, 2]);
        let both = named(&["circle", "straight", "circle", "straight"]);
        assert_eq!(fold_of(&both, 2), [0, 0, 1, 1], "of either manoeuvre one each");
        assert_eq!(fold_of(&[], 0), [0; 0]);
    }
}
