//! Speed from rest to rest.

/// How fast a manoeuvre is driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Top speed of the rear-axle centre, positive \[m/s\].
    pub speed: f64,
    /// Acceleration and deceleration, positive \[m/s^2\].
    pub acceleration: f64,
}

/// A trapezoid of the speed over time, or a triangle where the distance is too short for the top speed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trapezoid {
    length: f64,
    top: f64,
    acceleration: f64,
    /// End of speeding up, begin of slowing down, end \[s\].
    times: [f64; 3],
}

impl Trapezoid {
    /// The profile over `length` \[m\].
    pub(crate) fn new(length: f64, pace: &Pace) -> Self {
        let acceleration = pace.acceleration;
        let top = pace.speed.min((acceleration * length).sqrt());
        let ramp = top / acceleration;
        // Of a length of zero, nothing.
        let cruise = if top > 0.0 { (length / top - ramp).max(0.0) } else { 0.0 };
        Self { length, top, acceleration, times: [ramp, ramp + cruise, 2.0 * ramp + cruise] }
    }

    /// Duration \[s\].
    pub(crate) fn duration(&self) -> f64 {
        self.times[2]
    }

    /// Where its rate has kinks \[s\].
    pub(crate) fn kinks(&self) -> [f64; 3] {
        self.times
    }

    /// Distance \[m\], speed \[m/s\] and acceleration \[m/s^2\] at `time` \[s\].
    pub(crate) fn at(&self, time: f64) -> [f64; 3] {
        let [up, down, end] = self.times;
        let a = self.acceleration;
        if time <= 0.0 {
            [0.0, 0.0, 0.0]
        } else if time < up {
            [0.5 * a * time * time, a * time, a]
        } else if time < down {
            [self.top * (time - 0.5 * up), self.top, 0.0]
        } else if time < end {
            let left = end - time;
            [self.length - 0.5 * a * left * left, a * left, -a]
        } else {
            [self.length, 0.0, 0.0]
        }
    }

    /// When `distance` \[m\] is covered \[s\].
    pub(crate) fn time_at(&self, distance: f64) -> f64 {
        let [up, down, end] = self.times;
        let (ramp, left) = (0.5 * self.top * up, self.length - distance);
        if distance < ramp {
            (2.0 * distance.max(0.0) / self.acceleration).sqrt()
        } else if left < ramp {
            end - (2.0 * left.max(0.0) / self.acceleration).sqrt()
        } else if self.top > 0.0 {
            (up + (distance - ramp) / self.top).min(down)
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_is_the_integral_of_speed_and_time_its_inverse() {
        for (length, speed) in [(5.77, 0.09), (5.77, 0.26), (0.3, 1.0)] {
            let profile = Trapezoid::new(length, &Pace { speed, acceleration: 0.1 });
            let (end, steps) = (profile.duration(), 10_000);
            let step = end / f64::from(steps);
            let mut covered = 0.0;
            for k in 0..steps {
                let middle = profile.at((f64::from(k) + 0.5) * step);
                covered += middle[1] * step;
                let [distance, ..] = profile.at(f64::from(k + 1) * step);
                assert!((covered - distance).abs() < 1e-6, "{covered} against {distance}");
                // Where it comes to rest, a distance does not tell the time to more than its root.
                let again = profile.at(profile.time_at(distance))[0];
                assert!((again - distance).abs() < 1e-12);
            }
            assert_eq!(profile.at(end)[..2], [length, 0.0]);
        }
        assert_eq!(Trapezoid::new(0.0, &Pace { speed: 1.0, acceleration: 1.0 }).duration(), 0.0);
    }

    #[test]
    fn an_acceleration_without_limit_is_a_constant_speed() {
        let profile = Trapezoid::new(2.0, &Pace { speed: 0.5, acceleration: f64::INFINITY });
        assert_eq!(profile.duration(), 4.0);
        assert_eq!(profile.at(1.0), [0.5, 0.5, 0.0]);
        assert_eq!(profile.time_at(0.5), 1.0);
    }
}
