//! What was driven, readable at any time.

/// Number of integrals: x, y, yaw, motor, servo, signed distance, rotation of four wheels.
pub(crate) const COUNT: usize = 10;
/// Place of the servo's angle among them.
pub(crate) const SERVO: usize = 4;
/// See [`COUNT`].
pub(crate) type Values = [f64; COUNT];

/// A step of the integration: values and rates at both ends, and how far the rack is ahead of its servo there \[rad\].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    pub(crate) begin: f64,
    pub(crate) length: f64,
    pub(crate) values: [Values; 2],
    pub(crate) rates: [Values; 2],
    pub(crate) ahead: [f64; 2],
}

/// Steps that follow one another from time 0.
#[derive(Clone, Debug)]
pub(crate) struct Trajectory {
    pub(crate) start: Values,
    pub(crate) steps: Vec<Step>,
}

/// What is read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading {
    pub(crate) values: Values,
    pub(crate) rates: Values,
    /// Angle of the rack \[rad\].
    pub(crate) rack: f64,
}

impl Trajectory {
    /// Values and rates at `time` \[s\], by Hermite's cubic in between; before 0 the car stands as at its start, behind the
    /// end as there.
    pub(crate) fn at(&self, time: f64) -> Reading {
        let standing = Reading { values: self.start, rates: [0.0; COUNT], rack: 0.0 };
        let behind = self.steps.partition_point(|step| step.begin <= time);
        let Some(step) = behind.checked_sub(1).and_then(|at| self.steps.get(at)) else {
            return standing;
        };
        let (length, s) = (step.length, ((time - step.begin) / step.length).min(1.0));
        let (square, cube) = (s * s, s * s * s);
        let values: Values = core::array::from_fn(|i| {
            let ([a, b], [da, db]) = (step.values.map(|v| v[i]), step.rates.map(|r| r[i]));
            let rest = b - a;
            a + rest * (3.0 * square - 2.0 * cube)
                + length * (da * (s - 2.0 * square + cube) + db * (cube - square))
        });
        let rates = core::array::from_fn(|i| {
            let ([a, b], [da, db]) = (step.values.map(|v| v[i]), step.rates.map(|r| r[i]));
            (b - a) / length * 6.0 * (s - square)
                + da * (1.0 - 4.0 * s + 3.0 * square)
                + db * (3.0 * square - 2.0 * s)
        });
        let rack = values[SERVO] + step.ahead[0] + s * (step.ahead[1] - step.ahead[0]);
        Reading { values, rates, rack }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_read_exactly_between_its_ends() {
        let cubic = |t: f64| [t * t * t - 2.0 * t; COUNT];
        let slope = |t: f64| [3.0 * t * t - 2.0; COUNT];
        let step = Step {
            begin: 1.0,
            length: 0.5,
            values: [cubic(1.0), cubic(1.5)],
            rates: [slope(1.0), slope(1.5)],
            ahead: [0.1, 0.2],
        };
        let trajectory = Trajectory { start: cubic(0.0), steps: vec![step] };
        for time in [1.0, 1.2, 1.37, 1.5] {
            let read = trajectory.at(time);
            assert!((read.values[3] - cubic(time)[3]).abs() < 1e-12);
            assert!((read.rates[3] - slope(time)[3]).abs() < 1e-12);
        }
        assert!((trajectory.at(1.25).rack - cubic(1.25)[SERVO] - 0.15).abs() < 1e-12);
        assert_eq!(trajectory.at(-1.0).values, cubic(0.0));
        assert_eq!(trajectory.at(9.0).values, trajectory.at(1.5).values);
    }
}
