//! What simpler ways make of the same cases: the effect whose fit alone lowers the root mean square error most, the
//! effect that carries most where all are fitted at once, and chance.
//!
//! Both fits are linear, about the nominal vehicle, on wheels, steering, gyro and reference, each channel over its own
//! root mean square error. A patch of floor has no linear fit and is left out. Both know where each drive began.

use core::f64::consts::{FRAC_PI_2, TAU};

use kerbside_geometry::Vehicle;
use kerbside_proving_ground::cases::{Case, Drives, Errors, Plan, Rows};
use kerbside_simulation::effects::{Definition, library};
use kerbside_simulation::{Effects, Parameter, Trajectory};
use nalgebra::{DMatrix, DVector};

use super::holdout::simulated;

/// Names of the rivals.
pub const RIVALS: [&str; 2] = ["largest drop in RMSE", "all parameters at once"];
/// A column is the difference that this share of a parameter's range makes.
const SHARE: f64 = 0.1;
/// Weight of a parameter of that size against all errors together.
const RIDGE: f64 = 1e-6;
/// Channels: wheels, steering, gyro, x, y, yaw.
const CHANNELS: usize = 6;

type Channels = [Vec<f64>; CHANNELS];

/// Whether each rival names what was put in, and nothing else.
#[must_use]
pub fn right(case: &Case, driver: &dyn Drives) -> Vec<bool> {
    let truth: Vec<&str> = case.label().effects.iter().map(|effect| effect.id).collect();
    let named = named(case, driver);
    named.iter().map(|id| truth == [*id]).collect()
}

fn named(case: &Case, driver: &dyn Drives) -> [&'static str; 2] {
    let bench = Bench::new(case, driver);
    let columns: Vec<(&'static str, DVector<f64>)> = library()
        .iter()
        .filter(|definition| definition.id != "floor_patch")
        .flat_map(|definition| points(definition, &case.specification.vehicle))
        .map(|(id, effects)| (id, bench.column(&effects)))
        .collect();
    let ids: Vec<&'static str> = library().iter().map(|definition| definition.id).collect();
    let drop = |id: &str| {
        let own: Vec<_> =
            columns.iter().filter(|column| column.0 == id).map(|c| c.1.clone()).collect();
        explained(&bench.residual, &own).iter().sum::<f64>()
    };
    let all: Vec<_> = columns.iter().map(|column| column.1.clone()).collect();
    let shares = explained(&bench.residual, &all);
    let carried = |id: &str| -> f64 {
        let own = columns.iter().zip(&shares).filter(|(column, _)| column.0 == id);
        own.map(|(_, share)| share).sum()
    };
    [most(&ids, drop), most(&ids, carried)]
}

fn most(ids: &[&'static str], worth: impl Fn(&str) -> f64) -> &'static str {
    let best = ids.iter().map(|id| (worth(id), *id)).max_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or("", |best| best.1)
}

/// Points of an effect whose differences from nominal are its columns.
fn points(definition: &'static Definition, vehicle: &Vehicle) -> Vec<(&'static str, Effects)> {
    let id = definition.id;
    if id == "floor_slope" {
        let (Some(rate), Some(direction)) =
            (Parameter::find(id, "rate"), Parameter::find(id, "direction"))
        else {
            return Vec::new();
        };
        let slope = |way| {
            Effects::NEUTRAL.with(rate, SHARE * rate.range_for(vehicle).1).with(direction, way)
        };
        return [0.0, FRAC_PI_2].map(|way| (id, slope(way))).to_vec();
    }
    let point = |parameter: Parameter| {
        let (low, high) = parameter.range_for(vehicle);
        let neutral = parameter.neutral();
        let value = if neutral.is_finite() {
            neutral + SHARE * (high - neutral)
        } else {
            0.5 * (low + high)
        };
        (id, Effects::NEUTRAL.with(parameter, value))
    };
    Parameter::of(id).map(point).collect()
}

/// Shares of the fitted sum of squares, column by column.
fn explained(residual: &DVector<f64>, columns: &[DVector<f64>]) -> Vec<f64> {
    if columns.is_empty() {
        return Vec::new();
    }
    let design = DMatrix::from_columns(columns);
    let mut normal = design.tr_mul(&design);
    for i in 0..columns.len() {
        normal[(i, i)] += RIDGE * residual.norm_squared() + f64::MIN_POSITIVE;
    }
    let right = design.tr_mul(residual);
    let Some(root) = normal.cholesky() else { return vec![0.0; columns.len()] };
    let fitted = root.solve(&right);
    fitted.iter().zip(right.iter()).map(|(value, right)| value * right).collect()
}

/// What was recorded, and the nominal vehicle's prediction of it.
struct Bench<'a> {
    case: &'a Case,
    nominal: Vec<Channels>,
    /// One over the root mean square error of each channel.
    scale: [f64; CHANNELS],
    residual: DVector<f64>,
}

impl<'a> Bench<'a> {
    fn new(case: &'a Case, driver: &dyn Drives) -> Self {
        let runs = &case.specification.runs;
        let vehicle = &case.specification.vehicle;
        let nominal: Vec<Channels> =
            runs.iter().map(|plan| shown(case, plan, &Effects::NEUTRAL)).collect();
        let measured: Vec<Channels> = runs
            .iter()
            .map(|plan| {
                recorded(vehicle, &case.record_by(driver, plan, true, Errors::Unwrapped(0)))
            })
            .collect();
        let scale = core::array::from_fn(|channel| {
            let pairs = measured.iter().zip(&nominal);
            let off = pairs.flat_map(|(m, n)| m[channel].iter().zip(&n[channel]));
            let (sum, count) =
                off.fold((0.0, 0.0), |(sum, count), (m, n)| (sum + (m - n) * (m - n), count + 1.0));
            if sum > 0.0 { (count / sum).sqrt() } else { 0.0 }
        });
        let residual = DVector::from_vec(difference(&measured, &nominal, &scale));
        Self { case, nominal, scale, residual }
    }

    fn column(&self, effects: &Effects) -> DVector<f64> {
        let runs = self.case.specification.runs.iter();
        let with: Vec<Channels> = runs.map(|plan| shown(self.case, plan, effects)).collect();
        DVector::from_vec(difference(&with, &self.nominal, &self.scale))
    }
}

fn difference(a: &[Channels], b: &[Channels], scale: &[f64; CHANNELS]) -> Vec<f64> {
    let runs = a.iter().zip(b);
    runs.flat_map(|(a, b)| {
        (0..CHANNELS)
            .flat_map(move |c| a[c].iter().zip(&b[c]).map(move |(a, b)| scale[c] * (a - b)))
    })
    .collect()
}

/// Travel of each wheel since the first row \[m\] or its speed, then the others as they are read.
fn recorded(vehicle: &Vehicle, rows: &Rows) -> Channels {
    let mut out: Channels = Default::default();
    let first = rows.counts.first().map(|row| row.value).unwrap_or_default();
    let per_turn = vehicle.encoders.as_ref().map(|encoders| encoders.counts_per_revolution);
    for row in &rows.counts {
        for wheel in 0..4 {
            let counts = row.value[wheel].zip(first[wheel]);
            let per_turn = per_turn.and_then(|known| known[wheel]);
            let travel = counts.zip(per_turn).map(|((now, first), per_turn)| {
                (now - first) / per_turn * TAU * vehicle.radius[wheel]
            });
            out[0].push(travel.unwrap_or_default());
        }
    }
    out[0].extend(rows.speeds.iter().flat_map(|row| row.value));
    out[1].extend(rows.steering.iter().map(|row| row.value));
    out[2].extend(rows.yaw_rate.iter().map(|row| row.value));
    for row in &rows.reference {
        let (x, y, yaw) = row.value;
        out[3].push(x);
        out[4].push(y);
        out[5].extend(yaw);
    }
    out
}

/// The same of the simulator.
fn shown(case: &Case, plan: &Plan, effects: &Effects) -> Channels {
    let (vehicle, stamps) = (&case.specification.vehicle, &plan.stamps);
    let drive: Trajectory = simulated(case, plan, effects);
    let mut out: Channels = Default::default();
    let first = stamps.encoders.first().map(|t| drive.rotation(*t)).unwrap_or_default();
    for t in &stamps.encoders {
        let (now, speeds) = (drive.rotation(*t), drive.wheel_speed(*t));
        for wheel in 0..4 {
            out[0].push(match vehicle.encoders.as_ref() {
                None => speeds[wheel],
                Some(known) if known.counts_per_revolution[wheel].is_some() => {
                    (now[wheel] - first[wheel]) * vehicle.radius[wheel]
                }
                Some(_) => 0.0,
            });
        }
    }
    out[1].extend(stamps.steering.iter().map(|t| drive.steering(*t)));
    out[2].extend(stamps.gyro.iter().map(|t| drive.yaw_rate(*t)));
    for t in &stamps.reference {
        let pose = drive.reference(*t);
        out[3].push(pose.x);
        out[4].push(pose.y);
        out[5].extend(case.specification.reference_yaw.then_some(pose.yaw));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::plant::Simulated;
    use kerbside_proving_ground::cases::{Kind, Request};

    #[test]
    fn a_strong_effect_of_its_own_channel_is_seen_by_the_largest_drop() {
        let mut request = Request::new(Kind::Single);
        (request.ids, request.share, request.duration) = (vec!["gyro_bias"], Some(0.6), 8.0);
        let case = (0..50).find_map(|seed| Case::of(seed, &request)).unwrap();
        assert_eq!(named(&case, &Simulated)[0], "gyro_bias");
    }
}
