//! Motion over a distance from rest to rest.

/// A trapezoid of speed, averaged over a sliding window: speed and acceleration are continuous,
/// no limit of the trapezoid is exceeded, and the distance stays what it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Profile {
    distance: f64,
    peak: f64,
    acceleration: f64,
    deceleration: f64,
    /// Ends of speeding up, of constant speed, of slowing down \[s\].
    ends: [f64; 3],
    window: f64,
}

/// Where a profile is at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Motion {
    pub(crate) distance: f64,
    pub(crate) speed: f64,
    pub(crate) acceleration: f64,
}

impl Profile {
    /// Over `distance` >= 0 \[m or rad\], all limits above zero, smoothed over `window` \[s\].
    pub(crate) fn new(
        distance: f64,
        speed: f64,
        acceleration: f64,
        deceleration: f64,
        window: f64,
    ) -> Self {
        let per_square = 0.5 * (1.0 / acceleration + 1.0 / deceleration);
        let peak = speed.min((distance / per_square).sqrt());
        let (rise, fall) = (peak / acceleration, peak / deceleration);
        let hold =
            if peak > 0.0 { ((distance - per_square * peak * peak) / peak).max(0.0) } else { 0.0 };
        let ends = [rise, rise + hold, rise + hold + fall];
        Self { distance, peak, acceleration, deceleration, ends, window }
    }

    /// From rest to rest \[s\].
    pub(crate) fn duration(&self) -> f64 {
        self.ends[2] + self.window
    }

    /// At `time` \[s\] since its beginning; at rest before and after.
    pub(crate) fn at(&self, time: f64) -> Motion {
        if time <= 0.0 || self.distance == 0.0 {
            return Motion { distance: 0.0, speed: 0.0, acceleration: 0.0 };
        }
        if time >= self.duration() {
            return Motion { distance: self.distance, speed: 0.0, acceleration: 0.0 };
        }
        let (now, before) = (self.ramps(time), self.ramps(time - self.window));
        let mean = |i: usize| (now[i] - before[i]) / self.window;
        Motion {
            distance: mean(2).clamp(0.0, self.distance),
            speed: mean(1).clamp(0.0, self.peak),
            acceleration: mean(0).clamp(-self.deceleration, self.acceleration),
        }
    }

    /// Speed of the trapezoid, its integral, and the integral of that: sums of ramps that begin
    /// where its acceleration changes.
    fn ramps(&self, time: f64) -> [f64; 3] {
        let [rise, hold, fall] = self.ends;
        let (a, d) = (self.acceleration, self.deceleration);
        let mut sums = [0.0; 3];
        for (begin, rate) in [(0.0, a), (rise, -a), (hold, -d), (fall, d)] {
            let t = (time - begin).max(0.0);
            sums[0] += rate * t;
            sums[1] += rate * t * t / 2.0;
            sums[2] += rate * t * t * t / 6.0;
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn limits_hold_and_the_distance_is_driven(
            distance in 1e-6..30.0, speed in 0.05..3.0,
            a in 0.05..2.0, d in 0.05..2.0, window in 0.01..0.5,
        ) {
            let profile = Profile::new(distance, speed, a, d, window);
            let steps = 2000;
            let h = profile.duration() / f64::from(steps);
            let (mut driven, mut reached, mut last) = (0.0, 0.0, profile.at(0.0));
            for i in 1..=steps {
                let now = profile.at(h * f64::from(i));
                prop_assert!(now.distance >= last.distance - 1e-9);
                prop_assert!(now.speed <= speed && now.speed >= 0.0);
                prop_assert!(now.acceleration <= a && now.acceleration >= -d);
                driven += 0.5 * h * (now.speed + last.speed);
                reached += 0.5 * h * (now.acceleration + last.acceleration);
                prop_assert!((driven - now.distance).abs() < 4.0 * h * h * (a + d) + 1e-9);
                prop_assert!((reached - now.speed).abs() < 2.0 * h * (a + d) + 1e-9);
                last = now;
            }
            let end = profile.at(profile.duration());
            prop_assert_eq!(end, Motion { distance, speed: 0.0, acceleration: 0.0 });
        }
    }

    #[test]
    fn a_long_way_has_the_trapezoids_duration_and_top_speed() {
        let profile = Profile::new(1.0, 0.2, 0.1, 0.2, 0.25);
        assert!((profile.duration() - (2.0 + 3.5 + 1.0 + 0.25)).abs() < 1e-12);
        assert!((profile.at(4.0).speed - 0.2).abs() < 1e-12);
    }
}
