//! Whole drives at once: from recorded commands, or from recorded motion.

use kerbside_geometry::{Pose, Vehicle};

use crate::effects::Effects;
use crate::plant::Plant;
use crate::stepper::Stepper;
use crate::train::{Actuators, Measured, Sample};
use crate::trajectory::Trajectory;

/// What is asked of the actuators from an instant until the next command.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Stamp \[s\].
    pub t: f64,
    /// Speed of the rear-axle centre, negative in reverse \[m/s\].
    pub speed: f64,
    /// Road-wheel angle, left positive \[rad\].
    pub steering: f64,
}

/// A drive from commands.
#[derive(Clone, Copy, Debug)]
pub struct Drive<'a> {
    /// The nominal vehicle.
    pub vehicle: &'a Vehicle,
    /// What it differs by.
    pub effects: Effects,
    /// In the order of their stamps; before the first one both are 0.
    pub commands: &'a [Command],
    /// Pose of the body at t = 0, where it stands with straight wheels.
    pub start: Pose,
    /// Longest step of the integration \[s\]; [`crate::STEP`] unless there is a reason.
    pub step: f64,
}

impl Drive<'_> {
    /// Drives until `until` \[s\]. `out` is emptied first; its memory is used again.
    ///
    /// # Panics
    /// On a step that is not positive: time would stand still.
    pub fn trajectory(&self, until: f64, out: &mut Trajectory) {
        check(self.step);
        let plant = Plant::new(self.vehicle, &self.effects);
        let mut actuators = Actuators::new(&plant);
        for command in self.commands {
            actuators.command(command.t, command.speed, command.steering);
        }
        let stepper = Stepper::new(&plant, actuators, self.start, self.step);
        out.fill(&plant, stepper, until, self.step);
    }
}

/// A body driven by measured motion: what motor and rack did is known, only ground and sensors are
/// simulated.
#[derive(Clone, Copy, Debug)]
pub struct Follow<'a> {
    /// The nominal vehicle.
    pub vehicle: &'a Vehicle,
    /// What it differs by; the effects of the actuators change nothing here.
    pub effects: Effects,
    /// Speed of the motor \[m/s\]: mean rotation rate of the driven wheels times the mean of their
    /// nominal radii. In the order of time, straight lines in between.
    pub speeds: &'a [Sample],
    /// Angle of the rack \[rad\], likewise.
    pub racks: &'a [Sample],
    /// Pose of the body at t = 0.
    pub start: Pose,
    /// Longest step of the integration \[s\].
    pub step: f64,
}

impl Follow<'_> {
    /// Follows until `until` \[s\]. `out` is emptied first; its memory is used again.
    ///
    /// # Panics
    /// On a step that is not positive: time would stand still.
    pub fn trajectory(&self, until: f64, out: &mut Trajectory) {
        check(self.step);
        let plant = Plant::new(self.vehicle, &self.effects);
        let measured = Measured::new(self.speeds, self.racks);
        let stepper = Stepper::new(&plant, measured, self.start, self.step);
        out.fill(&plant, stepper, until, self.step);
    }
}

fn check(step: f64) {
    assert!(step > 0.0, "a step of {step} s never ends");
}
