//! How fast a plan drives and steers, and so how long everything takes.

use kerbside_geometry::{Vehicle, math};

use crate::PlannerSettings;
use crate::profile::Profile;

/// A plan brakes with no more than this share of the deceleration.
const MOST_DECELERATION: f64 = 0.5;
/// Time constants of the steering's lag after which it counts as still.
const SETTLED_LAGS: f64 = 3.0;

/// Speeds, rates and waits of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pace {
    speed: f64,
    acceleration: f64,
    deceleration: f64,
    steering_rate: f64,
    wheelbase: f64,
    window: f64,
    /// Until the wheels stand where they were told to.
    settle: f64,
    pause: f64,
}

impl Pace {
    pub(crate) fn new(vehicle: &Vehicle, settings: &PlannerSettings, speed: f64) -> Self {
        let (limits, response) = (&vehicle.limits, vehicle.response());
        let braking = settings.deceleration_share.min(MOST_DECELERATION);
        Self {
            speed: speed.min(limits.speed),
            acceleration: limits.acceleration * settings.acceleration_share,
            deceleration: limits.deceleration * braking,
            steering_rate: limits.steering_rate * settings.steering_rate_share,
            wheelbase: vehicle.wheelbase,
            window: settings.smoothing.max(1e-3),
            settle: response.steering_delay + SETTLED_LAGS * response.steering_lag,
            pause: settings.pause,
        }
    }

    /// Steering angle of a curvature \[rad\].
    pub(crate) fn steering(&self, curvature: f64) -> f64 {
        math::atan(curvature * self.wheelbase)
    }

    /// Over a segment of `length` \[m\], from rest to rest.
    pub(crate) fn drive(&self, length: f64) -> Profile {
        let Self { speed, acceleration, deceleration, window, .. } = *self;
        Profile::new(length.abs(), speed, acceleration, deceleration, window)
    }

    /// Over a change of steering by `angle` \[rad\], from rest to rest.
    pub(crate) fn steer(&self, angle: f64) -> Profile {
        // Half the window to reach the rate and half to be averaged over: the same time in all.
        let (rate, half) = (self.steering_rate, 0.5 * self.window);
        Profile::new(angle.abs(), rate, rate / half, rate / half, half)
    }

    /// Waits around a change of steering by `angle` \[rad\] at a standstill: before it, so that
    /// the car stands, and after it, so that the wheels do.
    pub(crate) fn waits(&self, angle: f64, gear_change: bool) -> (f64, f64) {
        let before = if gear_change { self.pause } else { 0.0 };
        (before, if angle == 0.0 { 0.0 } else { self.settle })
    }

    /// Least time over `length` \[m\] \[s\].
    pub(crate) fn fastest(&self, length: f64) -> f64 {
        length / self.speed
    }

    /// Time to drive a segment \[s\].
    pub(crate) fn drive_time(&self, length: f64) -> f64 {
        self.drive(length).duration()
    }

    /// What a change of the steering takes at least, however small \[s\].
    pub(crate) fn steer_least(&self) -> f64 {
        self.steer(0.0).duration() + self.settle
    }

    /// Time at a standstill to bring the steering from one curvature to another \[s\].
    pub(crate) fn steer_time(&self, from: f64, to: f64, gear_change: bool) -> f64 {
        let angle = self.steering(to) - self.steering(from);
        let (before, after) = self.waits(angle, gear_change);
        let moving = if angle == 0.0 { 0.0 } else { self.steer(angle).duration() };
        before + moving + after
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerbside_geometry::{Actuators, Limits};

    fn vehicle() -> Vehicle {
        Vehicle {
            wheelbase: 2.0,
            limits: Limits {
                speed: 1.0,
                acceleration: 0.4,
                deceleration: 0.8,
                steering: 0.5,
                steering_rate: 0.5,
            },
            actuators: Some(Actuators {
                steering_delay: 0.1,
                steering_lag: 0.2,
                ..Actuators::default()
            }),
            ..Vehicle::paper_car()
        }
    }

    #[test]
    fn a_plan_brakes_with_no_more_than_half_whatever_the_settings_say() {
        let settings = PlannerSettings { deceleration_share: 1.0, ..PlannerSettings::default() };
        let pace = Pace::new(&vehicle(), &settings, 9.0);
        let profile = pace.drive(20.0);
        // 5 s to speed up at 0.2, 2.5 s to brake at 0.4, the rest at the vehicle's top speed.
        let cruise = 20.0 - 0.5 * (5.0 + 2.5);
        assert!((profile.duration() - (5.0 + cruise + 2.5 + settings.smoothing)).abs() < 1e-12);
    }

    #[test]
    fn steering_takes_its_ramp_and_settles() {
        let settings = PlannerSettings { steering_rate_share: 0.8, ..PlannerSettings::default() };
        let pace = Pace::new(&vehicle(), &settings, 1.0);
        let curvature = math::tan(0.4) / 2.0;
        let expected = 0.4 / 0.4 + settings.smoothing + 0.1 + 3.0 * 0.2;
        assert!((pace.steer_time(0.0, curvature, false) - expected).abs() < 1e-12);
        let paused = pace.steer_time(0.0, curvature, true) - expected;
        assert!((paused - settings.pause).abs() < 1e-12);
        assert_eq!(pace.steer_time(curvature, curvature, false), 0.0);
    }
}
