//! What each sensor says of an increment: one linear row per sensor, and their weighted solution.

use kerbside_geometry::math;
use nalgebra::{Matrix2, Vector2};

use super::joint::{Piece, Sensitivity, Values};
use super::setup::Setup;
use crate::estimator::increment::Increment;
use crate::parameters::Parameter;

/// Rows of an increment: wheels fl, fr, rl, rr, then these.
pub(crate) const STEERING: usize = 4;
pub(crate) const GYRO: usize = 5;
pub(crate) const ROWS: usize = 6;

/// By which parameters [`Row::by_parameters`] derives each row.
pub(crate) const PARAMETERS_OF: [[usize; 3]; ROWS] = {
    let (front, rear) = (Parameter::TrackFront.index(), Parameter::TrackRear.index());
    let (base, zero) = (Parameter::Wheelbase.index(), Parameter::SteeringZero.index());
    let bias = Parameter::GyroBias.index();
    [
        [0, front, base],
        [1, front, base],
        [2, rear, 2],
        [3, rear, 3],
        [zero, base, zero],
        [bias, bias, bias],
    ]
};

/// A rear wheel that the vehicle turns about still has this share of the way of the virtual centre
/// wheel in its noise.
const LEAST_WAY: f64 = 0.1;

/// A determinant of the normal equations below this share of its largest possible value means that
/// the rows do not tell the motion.
const SINGULAR: f64 = 1e-9;

/// Reading = of . (distance, turn) + noise, with the parameters as they are believed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Row {
    /// The sensor was read.
    pub(crate) live: bool,
    /// It is believed.
    pub(crate) used: bool,
    pub(crate) reading: f64,
    pub(crate) of: [f64; 2],
    pub(crate) variance: f64,
    /// Derivative of (of . increment - reading) by two parameters, per radian of turn, and by one
    /// more as it is.
    pub(crate) per_turn: [(usize, f64); 2],
    pub(crate) own: (usize, f64),
}

impl Row {
    /// The derivative by each parameter of a motion that turns by `turn`.
    pub(crate) fn by_parameters(&self, turn: f64) -> [(usize, f64); 3] {
        let [(a, by_a), (b, by_b)] = self.per_turn;
        [self.own, (a, by_a * turn), (b, by_b * turn)]
    }

    /// What the reading says beyond (distance, turn).
    pub(crate) fn residual(&self, distance: f64, turn: f64) -> f64 {
        self.reading - self.of[0] * distance - self.of[1] * turn
    }
}

/// The vehicle's measures as they are believed at present.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measures {
    pub(crate) scale: [f64; 4],
    /// Lateral places of the wheels \[m\].
    pub(crate) lateral: [f64; 4],
    pub(crate) wheelbase: f64,
    /// Cosine and sine of the steering zero.
    zero: (f64, f64),
    bias: f64,
}

impl Measures {
    pub(crate) fn new(setup: &Setup, deviation: &Values) -> Self {
        let of = |parameter: Parameter| deviation[parameter.index()];
        let front = 0.5 * positive(setup.track_front, of(Parameter::TrackFront));
        let rear = 0.5 * positive(setup.track_rear, of(Parameter::TrackRear));
        let (sin, cos) = math::sin_cos(of(Parameter::SteeringZero));
        Self {
            scale: core::array::from_fn(|wheel| 1.0 + deviation[wheel]),
            lateral: [front, -front, rear, -rear],
            wheelbase: positive(setup.wheelbase, of(Parameter::Wheelbase)),
            zero: (cos, sin),
            bias: of(Parameter::GyroBias),
        }
    }

    /// Cosine and sine of the road-wheel angle where the sensor reads an angle with these.
    pub(crate) fn straightened(&self, (cos, sin): (f64, f64)) -> (f64, f64) {
        let (zero_cos, zero_sin) = self.zero;
        (cos * zero_cos + sin * zero_sin, sin * zero_cos - cos * zero_sin)
    }

    /// Direction of front wheel `wheel` (cosine, sine) and its way per way of the virtual centre
    /// wheel, at the centre wheel's direction. Regular at a quarter turn and beyond.
    pub(crate) fn front(&self, wheel: usize, (cos, sin): (f64, f64)) -> ([f64; 2], f64) {
        let along = cos - self.lateral[wheel] / self.wheelbase * sin;
        let length = (along * along + sin * sin).sqrt();
        if length < 1e-9 {
            return ([1.0, 0.0], LEAST_WAY);
        }
        ([along / length, sin / length], length.max(LEAST_WAY))
    }

    /// Way of rear wheel `wheel` per way of the virtual centre wheel.
    pub(crate) fn rear(&self, wheel: usize, (cos, sin): (f64, f64)) -> f64 {
        (cos - self.lateral[wheel] / self.wheelbase * sin).abs().max(LEAST_WAY)
    }

    /// The row of a wheel whose counter went on by `travel` \[m\].
    ///
    /// Rear: reading = distance - y turn. Front: the way hypot(distance - y turn, L turn), linear
    /// about the wheel's direction: what a wrong direction does is of second order.
    pub(crate) fn wheel(&self, wheel: usize, travel: f64, centre: (f64, f64), noise: f64) -> Row {
        let y = self.lateral[wheel];
        let half = 0.5_f64.copysign(if wheel.is_multiple_of(2) { 1.0 } else { -1.0 });
        let reading = travel * self.scale[wheel];
        let own = (wheel, -travel);
        if wheel >= 2 {
            let per_turn = [(Parameter::TrackRear.index(), -half), (wheel, 0.0)];
            let variance = noise * self.rear(wheel, centre);
            return Row { live: true, used: true, reading, of: [1.0, -y], variance, per_turn, own };
        }
        let ([cos, sin], way) = self.front(wheel, centre);
        let per_turn =
            [(Parameter::TrackFront.index(), -half * cos), (Parameter::Wheelbase.index(), sin)];
        let of = [cos, sin * self.wheelbase - y * cos];
        Row { live: true, used: true, reading, of, variance: noise * way, per_turn, own }
    }

    /// The virtual centre wheel does not roll across its direction: 0 = distance sin(phi) - L turn
    /// cos(phi). Equal to turn = distance tan(phi) / L, and regular at a quarter turn.
    pub(crate) fn steering(&self, (cos, sin): (f64, f64), variance: f64) -> Row {
        Row {
            live: true,
            used: true,
            reading: 0.0,
            of: [sin, -self.wheelbase * cos],
            variance,
            per_turn: [
                (Parameter::Wheelbase.index(), -cos),
                (Parameter::SteeringZero.index(), -self.wheelbase * sin),
            ],
            // The derivative by the zero per distance, until the distance is known.
            own: (Parameter::SteeringZero.index(), -cos),
        }
    }

    /// A gyro that turned by `turn` over `time` seconds.
    pub(crate) fn gyro(&self, turn: f64, variance: f64, time: f64) -> Row {
        let bias = Parameter::GyroBias.index();
        Row {
            live: true,
            used: true,
            reading: turn - self.bias * time,
            of: [0.0, 1.0],
            variance,
            per_turn: [(bias, 0.0), (bias, 0.0)],
            own: (bias, time),
        }
    }
}

/// A length that a correction cannot turn into none.
fn positive(nominal: f64, deviation: f64) -> f64 {
    nominal + deviation.clamp(-0.5 * nominal, nominal)
}

/// The motion that the used rows say, weighed by their variances (weighted least squares), its
/// covariance, and its sensitivity to the parameters; none where they do not tell it.
///
/// `length` makes a turn comparable with a distance. The steering row's derivative by the zero is
/// completed.
pub(crate) fn solve(rows: &mut [Row; ROWS], length: f64) -> Option<Piece> {
    let mut normal = Matrix2::<f64>::zeros();
    let mut right = Vector2::<f64>::zeros();
    for row in rows.iter().filter(|row| row.used) {
        let weight = 1.0 / row.variance;
        let (along, turning) = (row.of[0], row.of[1]);
        normal[(0, 0)] += weight * along * along;
        normal[(0, 1)] += weight * along * turning;
        normal[(1, 1)] += weight * turning * turning;
        right += weight * row.reading * Vector2::new(along, turning);
    }
    normal[(1, 0)] = normal[(0, 1)];
    let determinant = normal[(0, 0)] * normal[(1, 1)] - normal[(0, 1)] * normal[(0, 1)];
    let scale = normal[(0, 0)] + normal[(1, 1)] / (length * length);
    let least = SINGULAR * scale * scale * length * length;
    if !(determinant.is_finite() && determinant > least) {
        return None;
    }
    let inverse = Matrix2::new(normal[(1, 1)], -normal[(0, 1)], -normal[(0, 1)], normal[(0, 0)]);
    let covariance = inverse / determinant;
    let motion = covariance * right;
    rows[STEERING].own.1 *= motion.x;
    let by_parameters = sensitivity(rows, &covariance, motion.y);
    let increment = Increment { distance: motion.x, turn: motion.y, covariance };
    Some(Piece { increment, by_parameters })
}

fn sensitivity(rows: &[Row; ROWS], covariance: &Matrix2<f64>, turn: f64) -> Sensitivity {
    let mut by_parameters = Sensitivity::zeros();
    for row in rows.iter().filter(|row| row.used) {
        let gain = covariance * Vector2::from(row.of) / row.variance;
        for (parameter, slope) in row.by_parameters(turn) {
            by_parameters[(0, parameter)] -= gain.x * slope;
            by_parameters[(1, parameter)] -= gain.y * slope;
        }
    }
    by_parameters
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_row_derives_by_its_parameters() {
        let (vehicle, settings) = (kerbside_geometry::Vehicle::paper_car(), Default::default());
        let prior = crate::ParameterPrior::calibrated(&vehicle);
        let sensors = crate::Sensors {
            wheels: [true; 4],
            signal: crate::WheelSignal::Speeds,
            steering: true,
            gyro: true,
        };
        let scales = crate::wheels::scales(&vehicle, &sensors).unwrap();
        let setup = Setup::new(&vehicle, &sensors, &settings, &prior, &scales);
        let measures = Measures::new(&setup, &Values::zeros());
        let centre = (0.8, 0.6);
        let mut rows: Vec<Row> =
            (0..4).map(|wheel| measures.wheel(wheel, 0.1, centre, 1e-6)).collect();
        rows.push(measures.steering(centre, 1e-6));
        rows.push(measures.gyro(0.1, 1e-6, 0.1));
        for (row, expected) in rows.iter().zip(PARAMETERS_OF) {
            assert_eq!(row.by_parameters(0.1).map(|(parameter, _)| parameter), expected);
        }
    }
}
