//! Slip of an axle: rear and front say different things of the same motion.

use kerbside_geometry::Drive;

use super::record::{AxleSums, Record};
use super::rows::Measures;
use super::setup::Setup;
use super::state::State;
use crate::parameters::{Parameter, ParameterCovariance};

/// Time over which the axles are compared, and from which a slipping axle is left out \[ns\].
pub(crate) const WINDOW: u64 = 400_000_000;

/// What the axles may differ by for reasons that are not modelled: per metre \[1, rad/m\].
const SLACK_DISTANCE: f64 = 0.002;
const SLACK_TURN: f64 = 0.004;

/// Sum of squares beyond which an axle slips (chi-square, 2 degrees of freedom: one in 10^5).
const THRESHOLD: f64 = 23.0;

/// The steering angle names an axle that contradicts it by so many standard deviations, and by so
/// many times more than the other does.
const CONTRADICTION: f64 = 3.0;
const MARGIN: f64 = 2.0;

/// An axle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Axle {
    Front,
    Rear,
}

impl Axle {
    /// Its wheels.
    pub(crate) const fn wheels(self) -> [bool; 4] {
        match self {
            Self::Front => [true, true, false, false],
            Self::Rear => [false, false, true, true],
        }
    }
}

/// Slip, and whether the steering angle names the axle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Slip {
    pub(crate) axle: Axle,
    pub(crate) evident: bool,
}

/// The sums after `record`, which were `before` it.
///
/// Rear: mean and difference. Front: the same of the wheels' longitudinal travels, in the wheels'
/// own directions (per-wheel form); without a steering sensor, what they rolled beyond what the
/// rear says, of second order in a direction that lags. Against the steering angle: each axle's turn beyond its own
/// distance times tan(phi) / L.
pub(crate) fn sums(before: &AxleSums, state: &State, record: &Record) -> AxleSums {
    let mut sums = *before;
    let measures = state.measures();
    let centre = state.centre(record);
    if record.gap.is_some()
        || record.read != [true; 4]
        || !state.square()
        || !state.steers(record)
        || measures.lateral.contains(&0.0)
    {
        sums.lacking = sums.lacking.wrapping_add(1);
        return sums;
    }
    let travel: [f64; 4] =
        core::array::from_fn(|wheel| record.travel[wheel] * measures.scale[wheel]);
    let rear = mean_and_turn(travel[2], travel[3], measures.lateral[2]);
    let (left, right) = (measures.front(0, centre).0, measures.front(1, centre).0);
    let front = if record.steered.is_some() {
        mean_and_turn(travel[0] * left[0], travel[1] * right[0], measures.lateral[0])
    } else {
        let predicted = |wheel: usize, direction: [f64; 2]| {
            direction[0] * (rear.0 - measures.lateral[wheel] * rear.1)
                + direction[1] * measures.wheelbase * rear.1
        };
        let off = (travel[0] - predicted(0, left), travel[1] - predicted(1, right));
        let more = mean_and_turn(off.0, off.1, measures.lateral[0]);
        sums.across += 0.25 * (left[1] + right[1]).powi(2) * travel[2].abs().max(travel[3].abs());
        (rear.0 + more.0, rear.1 + more.1)
    };
    let across = 0.5 * (travel[0] * left[1] + travel[1] * right[1]);
    sums.way += 0.25 * travel.iter().map(|travel| travel.abs()).sum::<f64>();
    sums.distance += rear.0 - front.0;
    sums.turn += rear.1 - front.1;
    sums.rolled[0] += front.0;
    sums.rolled[1] += rear.0;
    sums.beyond_steering[0] += front.1 - across / measures.wheelbase;
    // Near a quarter turn the rear axle alone has no distance that a tangent could multiply.
    let tangent = centre.1 / centre.0.abs().max(0.2).copysign(centre.0);
    sums.beyond_steering[1] += rear.1 - rear.0 * tangent / measures.wheelbase;
    sums
}

/// Distance and turn of an axle whose left wheel is at `lateral`.
fn mean_and_turn(left: f64, right: f64, lateral: f64) -> (f64, f64) {
    (0.5 * (left + right), (right - left) / (2.0 * lateral))
}

/// The axle that slipped between two sums, if one did.
pub(crate) fn slipping(
    setup: &Setup,
    state: &State,
    then: &AxleSums,
    now: &AxleSums,
) -> Option<Slip> {
    if then.lacking != now.lacking {
        return None;
    }
    let way = now.way - then.way;
    let covariance = state.joint.covariance();
    let (mut distance, turn) = variances(setup, state.measures(), covariance, way);
    if way > 0.0 {
        // The rear's turn moves the front wheels across, and along where they are turned.
        distance += (now.across - then.across) / way * turn * setup.wheelbase * setup.wheelbase;
    }
    let (off, turned) = (now.distance - then.distance, now.turn - then.turn);
    let square = off * off / distance + turned * turned / turn;
    if way <= 0.0 || square <= THRESHOLD {
        return None;
    }
    Some(culprit(setup, covariance, turn, then, now))
}

/// Variances of the differences of distance and turn over `way`.
fn variances(
    setup: &Setup,
    measures: &Measures,
    covariance: &ParameterCovariance,
    way: f64,
) -> (f64, f64) {
    let (mut distance, mut turn) = ((SLACK_DISTANCE * way).powi(2), (SLACK_TURN * way).powi(2));
    for wheel in 0..4 {
        let track = 2.0 * measures.lateral[wheel];
        let scale = covariance[(wheel, wheel)] * way * way;
        let rolled = setup.wheel_variance[wheel] * way + setup.quantisation[wheel] + scale;
        distance += 0.25 * rolled;
        turn += rolled / (track * track);
    }
    (distance, turn)
}

/// Which axle it was: the one that contradicts the steering angle, else the driven one, else the
/// one that rolled farther.
fn culprit(
    setup: &Setup,
    covariance: &ParameterCovariance,
    variance: f64,
    then: &AxleSums,
    now: &AxleSums,
) -> Slip {
    let [front, rear] =
        [0, 1].map(|axle| (now.beyond_steering[axle] - then.beyond_steering[axle]).abs());
    let way = now.way - then.way;
    let zero = Parameter::SteeringZero.index();
    let steering = covariance[(zero, zero)] + setup.steering_variance;
    let share = way / setup.wheelbase;
    let least = CONTRADICTION * (variance + steering * share * share).sqrt();
    if setup.steered && rear > least && rear > MARGIN * front {
        return Slip { axle: Axle::Rear, evident: true };
    }
    if setup.steered && front > least && front > MARGIN * rear {
        return Slip { axle: Axle::Front, evident: true };
    }
    let rolled = |axle: usize| (now.rolled[axle] - then.rolled[axle]).abs();
    let axle = match setup.drive {
        Drive::Rear => Axle::Rear,
        Drive::Front => Axle::Front,
        Drive::All if rolled(0) > rolled(1) => Axle::Front,
        Drive::All => Axle::Rear,
    };
    Slip { axle, evident: false }
}
