//! Front and rear axle exchanged: in a curve the front wheels roll the longer way.

use kerbside_geometry::{Vehicle, math};

use super::grid::Grid;
use super::{Finding, Problem};
use crate::run::Run;

/// Share by which the front axle must roll farther for a run to tell, with straight runs beside it, and without.
const TELLS: f64 = 0.02;
const TELLS_ALONE: f64 = 0.08;
/// Share below which a run counts as straight.
const STRAIGHT: f64 = 0.005;

/// What a run says: logarithm of front over rear travel, as read and as its curvature asks for.
struct Ratio {
    run: String,
    read: f64,
    expected: f64,
}

/// Notes the runs in whose curves the rear wheels roll farther than the front wheels.
pub(crate) fn swapped_axles(runs: &[Run], vehicle: &Vehicle, list: &mut Vec<Finding>) {
    let forbidden =
        |run: &Run| list.iter().any(|found| found.forbids && found.run.as_ref() == Some(&run.name));
    let ratios: Vec<Ratio> =
        runs.iter().filter(|run| !forbidden(run)).filter_map(|run| ratio(run, vehicle)).collect();
    let mut straight: Vec<f64> =
        ratios.iter().filter(|ratio| ratio.expected < STRAIGHT).map(|ratio| ratio.read).collect();
    straight.sort_by(f64::total_cmp);
    // Radii that are wrong by some per cent show in straight runs alike.
    let base = straight.get(straight.len() / 2).copied();
    let tells = if base.is_some() { TELLS } else { TELLS_ALONE };
    let base = base.unwrap_or(0.0);
    for ratio in ratios.iter().filter(|ratio| ratio.expected > tells) {
        // As it should be; with this run's axles exchanged; with those of all runs, the straight ones too.
        let misfit = (ratio.read - base - ratio.expected).abs();
        let alone = (ratio.read + base + ratio.expected).abs();
        let all = (ratio.read - base + ratio.expected).abs();
        if misfit > tells && alone.min(all) < 0.4 * misfit {
            list.push(Finding {
                run: Some(ratio.run.clone()),
                problem: Problem::SwappedAxles,
                evidence: format!(
                    "by its curves and the straight runs the front wheels should roll {:.1} % farther than the rear \
                     wheels, and roll {:.1} % farther",
                    100.0 * (ratio.expected + base),
                    100.0 * ratio.read
                ),
                forbids: true,
            });
        }
    }
}

fn ratio(run: &Run, vehicle: &Vehicle) -> Option<Ratio> {
    let grid = Grid::new(run, vehicle)?;
    let axle = |left: usize| match (grid.travel(left), grid.travel(left + 1)) {
        (Some(left), Some(right)) => Some(0.5 * (left + right)),
        (one, other) => one.or(other).filter(|_| vehicle.wheel_position(wheel(left)).1 == 0.0),
    };
    let (front, rear) = (axle(0)?, axle(2)?);
    let (mut long, mut short) = (0.0, 0.0);
    // The sensor knows no track, and none that is exchanged.
    let turns = grid.steering_turn().unwrap_or_else(|| grid.turn());
    for (distance, turn) in grid.distance.iter().zip(turns) {
        short += distance.abs();
        long += math::hypot(*distance, vehicle.wheelbase * turn);
    }
    let known = front > 0.0 && rear > 0.0 && short > 0.0;
    known.then(|| Ratio {
        run: run.name.clone(),
        read: math::ln(front / rear),
        expected: math::ln(long / short),
    })
}

fn wheel(index: usize) -> kerbside_geometry::Wheel {
    kerbside_geometry::WHEELS[index]
}
