//! The start of a run: where the vehicle truly stands, and what the estimator is told of it.

use kerbside_geometry::{Pose, math};
use kerbside_messages::{Fix, Header, Nanos, text};
use kerbside_settings::Scenario;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A disturbed start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Where the vehicle stands.
    pub truth: Pose,
    /// Where the estimator is told that it stands.
    pub told: Pose,
    /// Variances of what it is told: each axis \[m^2\], heading \[rad^2\].
    pub variances: (f64, f64),
}

impl Start {
    /// The start that `seed` draws: uniform within the scenario's disturbance, and known to its accuracy.
    #[must_use]
    pub fn draw(scenario: &Scenario, seed: u64) -> Self {
        // A stream of its own, so that the vehicle's noise of the same seed is independent of the start.
        let mut random = Pcg64::seed_from_u64(seed ^ 0x5eed_57a2_7000_0000);
        let disturbance = scenario.disturbance;
        let start = scenario.start;
        let mut uniform = |bound: f64| bound * (2.0 * random.random::<f64>() - 1.0);
        let truth = Pose::new(
            start.x + uniform(disturbance.position),
            start.y + uniform(disturbance.position),
            start.yaw + uniform(disturbance.yaw),
        );
        let mut normal = |deviation: f64| deviation * gaussian(&mut random);
        let told = Pose::new(
            truth.x + normal(disturbance.known_position),
            truth.y + normal(disturbance.known_position),
            truth.yaw + normal(disturbance.known_yaw),
        );
        let variances = (disturbance.known_position.powi(2), disturbance.known_yaw.powi(2));
        Self { truth, told, variances }
    }

    /// The fix that tells the estimator.
    #[must_use]
    pub fn fix(&self, now: Nanos) -> Fix {
        let (position, yaw) = self.variances;
        Fix {
            header: Header::stamped(now, 0),
            x: self.told.x,
            y: self.told.y,
            yaw: self.told.yaw,
            covariance: [position, 0.0, 0.0, 0.0, position, 0.0, 0.0, 0.0, yaw],
            source: text::from_str("park"),
            ..Fix::default()
        }
    }
}

/// A standard normal number (Box and Muller, 1958), with the bits of our own transcendental functions.
fn gaussian(random: &mut Pcg64) -> f64 {
    let radius = (-2.0 * math::ln(1.0 - random.random::<f64>())).sqrt();
    radius * math::cos(core::f64::consts::TAU * random.random::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_stay_within_the_disturbance_and_differ_by_seed() {
        let parking = crate::configuration::parking(None, "garage", None).unwrap();
        let scenario = parking.scenario.value;
        let starts: Vec<_> = (0..200).map(|seed| Start::draw(&scenario, seed)).collect();
        for start in &starts {
            assert!((start.truth.x - scenario.start.x).abs() <= scenario.disturbance.position);
            assert!((start.truth.yaw - scenario.start.yaw).abs() <= scenario.disturbance.yaw);
            assert!(start.truth.distance(&start.told) < 6.0 * scenario.disturbance.known_position);
        }
        assert_eq!(starts[7], Start::draw(&scenario, 7));
        assert_ne!(starts[7].truth, starts[8].truth);
    }
}
