//! One wheel's reported speed, integrated.

use super::counter::{Bounds, Judgement};

/// One wheel of a vehicle that reports speeds instead of counts.
///
/// Travel is the integral of the speed by the trapezoidal rule over the vehicle's stamps. The vehicle
/// used a radius of its own: where the wheel's is known better, `scale` makes up for it. A missing reading is bridged by the straight line
/// between its neighbours.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Speedometer {
    top_speed: f64,
    scale: f64,
    accepted: Option<(f64, f64)>,
    travel: f64,
}

impl Speedometer {
    pub(crate) fn new(top_speed: f64, scale: f64) -> Self {
        Self { top_speed, scale, accepted: None, travel: 0.0 }
    }

    /// Forgets its readings: the next one is the first of an epoch, in which travel begins at 0.
    pub(crate) fn forget(&mut self) {
        *self = Self::new(self.top_speed, self.scale);
    }

    /// Travel since the epoch began \[m\].
    pub(crate) fn travel(&self) -> f64 {
        self.travel
    }

    /// Takes `speed` \[m/s\] as reported, read at `time` \[s\].
    pub(crate) fn read(&mut self, speed: f64, time: f64, bounds: &Bounds) -> Judgement {
        let speed = self.scale * speed;
        if !speed.is_finite() || speed.abs() > self.top_speed * bounds.speed_margin {
            return Judgement::Implausible;
        }
        let Some((speed_before, time_before)) = self.accepted.replace((speed, time)) else {
            return Judgement::First;
        };
        let interval = time - time_before;
        if interval > bounds.longest_gap {
            return Judgement::Lost;
        }
        let rolled = 0.5 * (speed_before + speed) * interval;
        self.travel += rolled;
        Judgement::Turned(rolled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Bounds = Bounds { speed_margin: 3.0, longest_gap: 2.0, shortest: 0.0 };

    #[test]
    fn a_ramp_is_integrated_exactly() {
        let mut wheel = Speedometer::new(1.0, 1.0);
        for step in 0..=100 {
            let time = f64::from(step * step) * 1e-3;
            wheel.read(-0.1 * time, time, &BOUNDS);
        }
        assert!((wheel.travel() + 0.05 * 100.0).abs() < 1e-12);
    }

    #[test]
    fn a_radius_that_is_known_better_scales_the_speed() {
        let mut wheel = Speedometer::new(1.0, 1.25);
        wheel.read(0.4, 0.0, &BOUNDS);
        assert_eq!(wheel.read(0.4, 1.0, &BOUNDS), Judgement::Turned(0.5));
        assert_eq!(wheel.travel(), 0.5);
    }

    #[test]
    fn speeds_beyond_belief_are_bridged() {
        let mut wheel = Speedometer::new(1.0, 1.0);
        wheel.read(0.5, 0.0, &BOUNDS);
        assert_eq!(wheel.read(3.1, 0.1, &BOUNDS), Judgement::Implausible);
        assert_eq!(wheel.read(f64::NAN, 0.15, &BOUNDS), Judgement::Implausible);
        assert_eq!(wheel.read(0.5, 0.2, &BOUNDS), Judgement::Turned(0.1));
    }

    #[test]
    fn a_long_silence_is_lost_motion() {
        let mut wheel = Speedometer::new(1.0, 1.0);
        wheel.read(0.5, 0.0, &BOUNDS);
        assert_eq!(wheel.read(0.5, 2.5, &BOUNDS), Judgement::Lost);
        assert_eq!(wheel.travel(), 0.0);
    }
}
