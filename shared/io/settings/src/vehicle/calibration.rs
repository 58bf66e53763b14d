//! Where the values of a calibrated vehicle's file come from.

use std::collections::BTreeMap;

use super::VehicleDraft;
use crate::declare::{Kind, Range, Reading, Schema, Value};
use crate::problem::Cause;

/// Parameters that a calibration identifies, by the key that holds them, in the order in which it counts them.
pub const CALIBRATED: &[&str] = &[
    "radius.fl",
    "radius.fr",
    "radius.rl",
    "radius.rr",
    "track_front",
    "track_rear",
    "wheelbase",
    "steering_sensor.offset",
    "steering_sensor.gain",
    "reference.marker.x",
    "reference.marker.y",
    "reference.marker.yaw",
];

/// A calibration that the vehicle's values come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Calibration {
    /// `joint` or `closed-form`.
    pub method: String,
    /// Version of kerbside.
    pub version: String,
    /// Day, as year-month-day (UTC).
    pub date: String,
    /// Runs it was fitted to.
    pub runs: Vec<String>,
    /// Runs that were left out by name and judged.
    pub left_out: Vec<String>,
    /// Runs that were rejected, with why.
    pub rejected: BTreeMap<String, Value>,
    /// Residuals per run in standard deviations, and what else is known of the fit.
    pub residuals: BTreeMap<String, Value>,
    /// The parameters that were identified, in the order of the covariance; names as in [`CALIBRATED`].
    pub parameters: Vec<String>,
    /// Their covariance, rows and columns in the order of `parameters`, each in its key's unit; empty where the
    /// method gives none.
    pub covariance: Vec<Vec<f64>>,
    /// Standard deviations of `parameters` from drive to drive, beyond what the readings' noise explains; empty where
    /// there is nothing beyond.
    pub allowance: Vec<f64>,
}

impl Calibration {
    /// Covariance of two parameters in the next drive: of what was found, and on the diagonal of what differs from drive to
    /// drive. See [`Self::covariance_of`].
    #[must_use]
    pub fn covariance_in_use(&self, one: &str, other: &str) -> Option<f64> {
        let found = self.covariance_of(one, other)?;
        let place = self.parameters.iter().position(|known| known == one);
        let allowed = place.filter(|_| one == other).and_then(|place| self.allowance.get(place));
        Some(found + allowed.map_or(0.0, |deviation| deviation * deviation))
    }

    /// Covariance of two parameters by their key, in the product of their units; none where nothing is stated.
    #[must_use]
    pub fn covariance_of(&self, one: &str, other: &str) -> Option<f64> {
        let place = |name: &str| self.parameters.iter().position(|known| known == name);
        self.covariance.get(place(one)?)?.get(place(other)?).copied()
    }
}

const NAME: Kind = Kind::Text;
const NAMES: Kind = Kind::List { of: &NAME, least: 0, most: usize::MAX };
const KEY: Kind = Kind::Choice(CALIBRATED);
const KEYS: Kind = Kind::List { of: &KEY, least: 0, most: CALIBRATED.len() };
const ENTRY: Kind = Kind::unit("product of the units", Range::ANY);
const ROW: Kind = Kind::List { of: &ENTRY, least: 1, most: CALIBRATED.len() };
const DEVIATION: Kind = Kind::unit("unit of its key", Range::from(0.0).to(10_000.0));
const DEVIATIONS: Kind = Kind::List { of: &DEVIATION, least: 0, most: CALIBRATED.len() };
const MATRIX: Kind = Kind::List { of: &ROW, least: 0, most: CALIBRATED.len() };

/// The keys of `[calibration]`.
pub(super) fn declare(schema: Schema<VehicleDraft>) -> Schema<VehicleDraft> {
    let schema = schema
        .optional_section(
            "calibration",
            "Where these values come from; `kerbside calibrate` writes it. Absent: not calibrated.",
        )
        .required(
            "calibration.method",
            Kind::Choice(&["joint", "closed-form"]),
            "How the parameters were identified.",
            |v| &mut v.calibration.method,
        )
        .required("calibration.version", Kind::Text, "Version of kerbside.", |v| {
            &mut v.calibration.version
        })
        .required("calibration.date", Kind::Text, "Day, as year-month-day (UTC).", |v| {
            &mut v.calibration.date
        })
        .required("calibration.runs", NAMES, "Runs it was fitted to.", |v| &mut v.calibration.runs)
        .optional(
            "calibration.left_out",
            NAMES,
            "none by name",
            "Runs that were left out by name and judged.",
            |v| &mut v.calibration.left_out,
        );
    declare_result(schema)
}

fn declare_result(schema: Schema<VehicleDraft>) -> Schema<VehicleDraft> {
    schema
        .optional(
            "calibration.rejected",
            Kind::Free,
            "none",
            "Runs that were rejected, each with why.",
            |v| &mut v.calibration.rejected,
        )
        .optional(
            "calibration.residuals",
            Kind::Free,
            "not stated",
            "Residuals per run in standard deviations, and what else is known of the fit.",
            |v| &mut v.calibration.residuals,
        )
        .required(
            "calibration.parameters",
            KEYS,
            "The parameters that were identified, in the order of the covariance.",
            |v| &mut v.calibration.parameters,
        )
        .optional(
            "calibration.covariance",
            MATRIX,
            "the method gives none",
            "Covariance of the parameters, each in its key's unit.",
            |v| &mut v.calibration.covariance,
        )
        .optional(
            "calibration.allowance",
            DEVIATIONS,
            "nothing beyond the noise of the readings",
            "Standard deviations of the parameters from drive to drive, beyond what the readings' noise explains, each in \
             its key's unit. The estimator's prior adds their squares to the covariance.",
            |v| &mut v.calibration.allowance,
        )
}

/// Reports a covariance or an allowance that is not one of the parameters.
pub(super) fn check(reading: &mut Reading<'_, VehicleDraft>, found: &Calibration) {
    let (allowed, parameters) = (found.allowance.len(), found.parameters.len());
    if allowed != 0 && allowed != parameters {
        reading.refuse(
            "calibration.allowance",
            &format!("{allowed} entries"),
            Cause::Conflict("not one for each of calibration.parameters".to_owned()),
            format!("{parameters} entries"),
        );
    }
    let (matrix, count) = (&found.covariance, found.parameters.len());
    let square = matrix.len() == count && matrix.iter().all(|row| row.len() == count);
    if matrix.is_empty() || square && is_covariance(matrix) {
        return;
    }
    let cause = "no covariance of calibration.parameters".to_owned();
    reading.refuse(
        "calibration.covariance",
        &format!("{} rows", matrix.len()),
        Cause::Conflict(cause),
        format!("{count} rows of {count} entries, symmetric, none below 0 on the diagonal"),
    );
}

fn is_covariance(matrix: &[Vec<f64>]) -> bool {
    let pairs = (0..matrix.len()).flat_map(|i| (0..=i).map(move |j| (i, j)));
    pairs.into_iter().all(|(i, j)| {
        let (one, other) = (matrix[i][j], matrix[j][i]);
        // As written, the two halves are the same number.
        one == other && one * one <= matrix[i][i] * matrix[j][j] * (1.0 + 1e-6)
    }) && (0..matrix.len()).all(|i| matrix[i][i] >= 0.0)
}
