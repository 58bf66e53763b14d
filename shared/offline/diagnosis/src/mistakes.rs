//! Mistakes in one's own description or in a recorded signal: each is undone on trial, before any physics is asked.

use core::f64::consts::{FRAC_PI_2, PI};
use kerbside_geometry::math;

use kerbside_simulation::Effects;
use kerbside_simulation::effects::Link;

use crate::bench::Bench;
use crate::case::{Case, Series, Wheels};
use crate::noise::Noise;
use crate::nuisance::Nuisance;
use crate::prepare::Ready;
use crate::verdict::Mistake;

/// A mistake, and the case as it would be without.
struct Trial {
    kind: &'static str,
    detail: String,
    link: Link,
    case: Case,
}

/// What is left of the residuals' size where a mistake is undone, at most.
const LEFT: f64 = 0.35;
/// The same where what is left is still large: then it may be something else that a mistake happens to hide.
const NEARLY: f64 = 0.1;
/// Mean robust size of the residuals below which nothing looks like a mistake.
const SMALL: f64 = 1.2;

/// The mistake that explains most of what is wrong with a case; none where none explains nearly all of it.
pub(crate) fn find(
    case: &Case,
    nuisances: &[Nuisance],
    prior: impl Fn(&Ready<'_>) -> Noise,
) -> Option<Mistake> {
    let size = |case: &Case| size_of(case, nuisances, &prior);
    let before = size(case)?;
    if before < SMALL {
        return None;
    }
    let mut best: Option<(f64, Trial)> = None;
    for trial in trials(case) {
        let Some(after) = size(&trial.case) else { continue };
        if best.as_ref().is_none_or(|(least, _)| after < *least) {
            best = Some((after, trial));
        }
    }
    let (after, trial) = best?;
    (after < LEFT * before && (after < SMALL || after < NEARLY * before)).then_some(Mistake {
        kind: trial.kind,
        detail: trial.detail,
        link: trial.link,
    })
}

/// Mean robust size of the whitened residuals of the nominal vehicle: the logarithm tames what is very wrong.
fn size_of(
    case: &Case,
    nuisances: &[Nuisance],
    prior: &impl Fn(&Ready<'_>) -> Noise,
) -> Option<f64> {
    let ready = Ready::new(case);
    let bench = Bench::new(&ready, nuisances, &Effects::NEUTRAL, &prior(&ready));
    let whole = bench.whole(&Effects::NEUTRAL);
    let values = bench.values();
    if values == 0 || !bench.is_whole() {
        return None;
    }
    let sum: f64 =
        whole.iter().flat_map(|run| run.iter()).map(|z| math::ln(1.0 + z * z / 9.0)).sum();
    #[allow(clippy::cast_precision_loss)]
    Some(sum / values as f64)
}

fn trials(case: &Case) -> Vec<Trial> {
    let mut all = Vec::new();
    signs(case, &mut all);
    swaps(case, &mut all);
    units(case, &mut all);
    description(case, &mut all);
    frames(case, &mut all);
    all
}

fn with(case: &Case, change: impl Fn(&mut Case)) -> Case {
    let mut case = case.clone();
    change(&mut case);
    case
}

fn scaled<const N: usize>(series: &mut Series<N>, columns: &[usize], factor: f64) {
    for row in &mut series.value {
        for column in columns {
            row[*column] *= factor;
        }
    }
}

const WHEEL: [&str; 4] = ["front left", "front right", "rear left", "rear right"];
const ALL: [usize; 4] = [0, 1, 2, 3];

fn signs(case: &Case, all: &mut Vec<Trial>) {
    let mut put = |detail: &str, link: Link, change: &dyn Fn(&mut Case)| {
        all.push(Trial { kind: "sign", detail: detail.to_owned(), link, case: with(case, change) });
    };
    put(
        "the steering sensor turns the wrong way: steering.csv has the opposite sign",
        Link::Sensing,
        &|case| {
            case.runs.iter_mut().for_each(|run| scaled(&mut run.steering, &[0], -1.0));
        },
    );
    put(
        "the commanded steering has the opposite sign in commands.csv",
        Link::SteeringActuation,
        &|case| {
            case.runs
                .iter_mut()
                .flat_map(|run| &mut run.commands)
                .for_each(|c| c.steering = -c.steering);
        },
    );
    put(
        "commands and sensor count steering to the right as positive",
        Link::SteeringActuation,
        &|case| {
            for run in &mut case.runs {
                scaled(&mut run.steering, &[0], -1.0);
                run.commands.iter_mut().for_each(|c| c.steering = -c.steering);
            }
        },
    );
    put(
        "the commanded speed has the opposite sign in commands.csv",
        Link::SpeedActuation,
        &|case| {
            case.runs.iter_mut().flat_map(|run| &mut run.commands).for_each(|c| c.speed = -c.speed);
        },
    );
    put("the gyro turns the wrong way: imu.csv has the opposite sign", Link::Sensing, &|case| {
        case.runs.iter_mut().for_each(|run| scaled(&mut run.gyro, &[0], -1.0));
    });
    put("all wheels count backwards", Link::Sensing, &|case| {
        case.runs.iter_mut().for_each(|run| scaled(run.wheels.series_mut(), &ALL, -1.0));
    });
    for (wheel, name) in WHEEL.into_iter().enumerate() {
        put(&format!("the {name} wheel counts backwards"), Link::Sensing, &|case| {
            case.runs.iter_mut().for_each(|run| scaled(run.wheels.series_mut(), &[wheel], -1.0));
        });
    }
}

fn swaps(case: &Case, all: &mut Vec<Trial>) {
    for (detail, order) in [
        ("the left and right wheels are exchanged", [1, 0, 3, 2]),
        ("the front wheels are exchanged, left for right", [1, 0, 2, 3]),
        ("the rear wheels are exchanged, left for right", [0, 1, 3, 2]),
        ("the front and rear wheels are exchanged", [2, 3, 0, 1]),
    ] {
        let change = |case: &mut Case| {
            for row in case.runs.iter_mut().flat_map(|run| &mut run.wheels.series_mut().value) {
                *row = order.map(|wheel: usize| row[wheel]);
            }
        };
        all.push(Trial {
            kind: "swap",
            detail: detail.to_owned(),
            link: Link::Sensing,
            case: with(case, change),
        });
    }
}

fn units(case: &Case, all: &mut Vec<Trial>) {
    let radians = PI / 180.0;
    let mut put = |kind, detail: &str, link: Link, change: &dyn Fn(&mut Case)| {
        all.push(Trial { kind, detail: detail.to_owned(), link, case: with(case, change) });
    };
    put("degrees", "the steering sensor is recorded in degrees", Link::Sensing, &|case| {
        case.runs.iter_mut().for_each(|run| scaled(&mut run.steering, &[0], radians));
    });
    put(
        "degrees",
        "the commanded steering is recorded in degrees",
        Link::SteeringActuation,
        &|case| {
            case.runs
                .iter_mut()
                .flat_map(|run| &mut run.commands)
                .for_each(|c| c.steering *= radians);
        },
    );
    put("degrees", "the gyro is recorded in degrees per second", Link::Sensing, &|case| {
        case.runs.iter_mut().for_each(|run| scaled(&mut run.gyro, &[0], radians));
    });
    put("degrees", "the reference's yaw is recorded in degrees", Link::Reference, &|case| {
        case.runs.iter_mut().for_each(|run| scaled(&mut run.reference, &[2], radians));
    });
    if case.runs.iter().any(|run| matches!(run.wheels, Wheels::Speed(_))) {
        put("unit", "wheel speeds are recorded in km/h", Link::Sensing, &|case| {
            case.runs.iter_mut().for_each(|run| scaled(run.wheels.series_mut(), &ALL, 1.0 / 3.6));
        });
    }
    put("unit", "the commanded speed is recorded in km/h", Link::SpeedActuation, &|case| {
        case.runs.iter_mut().flat_map(|run| &mut run.commands).for_each(|c| c.speed /= 3.6);
    });
    put("unit", "the reference's position is recorded in mm", Link::Reference, &|case| {
        case.runs.iter_mut().for_each(|run| scaled(&mut run.reference, &[0, 1], 1e-3));
    });
}

fn description(case: &Case, all: &mut Vec<Trial>) {
    let mut put = |kind, detail: &str, change: &dyn Fn(&mut Case)| {
        all.push(Trial {
            kind,
            detail: detail.to_owned(),
            link: Link::Ground,
            case: with(case, change),
        });
    };
    put("track_for_wheelbase", "vehicle.toml: wheelbase and track are exchanged", &|case| {
        let v = &mut case.vehicle;
        let track = if v.track_rear > 0.0 { v.track_rear } else { v.track_front };
        (v.track_front, v.track_rear, v.wheelbase) = (v.wheelbase, v.wheelbase, track);
    });
    put("diameter_for_radius", "vehicle.toml: the radii are diameters", &|case| {
        case.vehicle.radius = case.vehicle.radius.map(|radius| 0.5 * radius);
    });
    put("unit", "vehicle.toml: wheelbase and tracks are in mm", &|case| {
        let v = &mut case.vehicle;
        v.wheelbase *= 1e-3;
        v.track_front *= 1e-3;
        v.track_rear *= 1e-3;
    });
    put("unit", "vehicle.toml: the radii are in mm", &|case| {
        case.vehicle.radius = case.vehicle.radius.map(|radius| 1e-3 * radius);
    });
    put("unit", "vehicle.toml: the speed limit is in km/h", &|case| {
        case.vehicle.limits.speed /= 3.6
    });
    put("degrees", "vehicle.toml: the steering limit is in degrees", &|case| {
        case.vehicle.limits.steering *= PI / 180.0
    });
}

fn frames(case: &Case, all: &mut Vec<Trial>) {
    let mut put = |detail: &str, change: &dyn Fn(&mut [f64; 3])| {
        let changed = with(case, |case| {
            case.runs.iter_mut().flat_map(|run| &mut run.reference.value).for_each(change);
        });
        all.push(Trial {
            kind: "frame",
            detail: detail.to_owned(),
            link: Link::Reference,
            case: changed,
        });
    };
    for (words, turn) in [
        ("90 degrees to the left", FRAC_PI_2),
        ("90 degrees to the right", -FRAC_PI_2),
        ("half a turn", PI),
    ] {
        put(&format!("the reference's yaw is off by {words}"), &move |row| row[2] -= turn);
    }
    put("the reference's x and y are exchanged", &|row| row.swap(0, 1));
    put("the reference's x and y are exchanged, its yaw counted from there", &|row| {
        row.swap(0, 1);
        row[2] = FRAC_PI_2 - row[2];
    });
    put("the reference's y points the other way", &|row| {
        row[1] = -row[1];
        row[2] = -row[2];
    });
}
