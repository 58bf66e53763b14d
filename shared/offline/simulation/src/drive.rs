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

/// How a car moves where a recording begins.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InMotion {
    /// Speed of the motor through the mean nominal radius of the driven wheels \[m/s\].
    pub speed: f64,
    /// Angle of the rack \[rad\].
    pub rack: f64,
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
        self.trajectory_from(&InMotion::default(), until, out);
    }

    /// The same from a car that is under way at t = 0: a recording may begin where it likes. Commands stamped before
    /// 0 act as they would have; delayed sensors show the motion carried on backwards.
    ///
    /// # Panics
    /// See [`Self::trajectory`].
    pub fn trajectory_from(&self, motion: &InMotion, until: f64, out: &mut Trajectory) {
        check(self.step);
        let plant = Plant::new(self.vehicle, &self.effects);
        let mut actuators = Actuators::new(&plant);
        actuators.move_on(motion.speed, motion.rack);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Parameter;
    use crate::simulator::STEP;

    const COMMANDS: [Command; 3] = [
        Command { t: 0.2, speed: 0.4, steering: 0.3 },
        Command { t: 3.01, speed: -0.3, steering: -0.2 },
        Command { t: 7.0, speed: 0.0, steering: 0.0 },
    ];

    /// A car whose ground does everything that depends on motor and rack alone.
    fn effects() -> Effects {
        let parameter = |id, name| Parameter::find(id, name).unwrap();
        Effects::NEUTRAL
            .with(parameter("understeer", "gradient"), 1.5)
            .with(parameter("acceleration_slip", "rate"), 0.3)
            .with(parameter("lateral_drift", "rate"), 0.03)
            .with(parameter("drive_slip", "ratio"), 0.05)
            .with(parameter("reference_delay", "delay"), 0.1)
    }

    #[test]
    fn to_follow_what_motor_and_rack_did_repeats_the_drive() {
        let (vehicle, start) = (Vehicle::paper_car(), Pose::new(0.2, -0.1, 0.4));
        let (mut driven, mut followed) = (Trajectory::new(), Trajectory::new());
        let drive =
            Drive { vehicle: &vehicle, effects: effects(), commands: &COMMANDS, start, step: STEP };
        drive.trajectory(10.0, &mut driven);
        let samples = |value: fn(&crate::Knot) -> f64| -> Vec<Sample> {
            driven.knots().iter().map(|knot| Sample { t: knot.time, value: value(knot) }).collect()
        };
        let (speeds, racks) = (samples(|knot| knot.motor_speed), samples(|knot| knot.rack));
        let follow = Follow {
            vehicle: &vehicle,
            effects: effects(),
            speeds: &speeds,
            racks: &racks,
            start,
            step: STEP,
        };
        follow.trajectory(10.0, &mut followed);
        for step in 0..100 {
            let t = f64::from(step) * 0.1;
            let error = followed.reference(t).seen_from(&driven.reference(t));
            // What straight lines between samples of 5 ms lose.
            assert!(error.x.abs() + error.y.abs() + error.yaw.abs() < 1e-5, "{t}: {error:?}");
            for wheel in 0..4 {
                assert!((followed.rotation(t)[wheel] - driven.rotation(t)[wheel]).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn a_recording_that_begins_under_way_goes_on_as_the_whole_one() {
        let vehicle = Vehicle::paper_car();
        let late = Effects::NEUTRAL
            .with(Parameter::find("encoder_delay", "delay").unwrap(), 0.1)
            .with(Parameter::find("reference_delay", "delay").unwrap(), 0.1);
        let drive = |commands| Drive {
            vehicle: &vehicle,
            effects: late,
            commands,
            start: Pose::default(),
            step: STEP,
        };
        let mut whole = Trajectory::new();
        drive(&COMMANDS).trajectory(10.0, &mut whole);
        let cut = 2.0;
        let now = whole.state(cut);
        let motion = InMotion { speed: now.motor_speed, rack: now.rack };
        let commands = COMMANDS.map(|command| Command { t: command.t - cut, ..command });
        let mut rest = Trajectory::new();
        Drive { start: now.pose, ..drive(&commands) }.trajectory_from(&motion, 8.0, &mut rest);
        for step in 0..80 {
            let t = f64::from(step) * 0.1;
            let error = rest.reference(t).seen_from(&whole.reference(cut + t));
            assert!(error.x.abs() + error.y.abs() + error.yaw.abs() < 1e-3, "{t}: {error:?}");
            let (a, b) = (rest.rotation(t)[2] - rest.rotation(0.0)[2], whole.rotation(cut + t)[2]);
            assert!((a - b + whole.rotation(cut)[2]).abs() < 1e-3, "{t}");
        }
    }

    #[test]
    fn few_samples_are_joined_by_lines_and_hold_at_both_ends() {
        let vehicle = Vehicle::paper_car();
        let speeds = [Sample { t: 1.0, value: 0.2 }, Sample { t: 3.0, value: -0.2 }];
        let follow = Follow {
            vehicle: &vehicle,
            effects: Effects::NEUTRAL,
            speeds: &speeds,
            racks: &[],
            start: Pose::default(),
            step: 0.02,
        };
        let mut trajectory = Trajectory::new();
        follow.trajectory(4.0, &mut trajectory);
        for (t, x) in [(0.0, 0.0), (0.5, 0.1), (1.0, 0.2), (2.0, 0.3), (3.0, 0.2), (4.0, 0.0)] {
            assert!((trajectory.pose(t).x - x).abs() < 1e-9, "{t}: {:?}", trajectory.pose(t));
        }
        assert_eq!(trajectory.pose(-1.0), Pose::new(-0.2, 0.0, 0.0), "it came from there");
        assert_eq!(trajectory.pose(9.0), trajectory.pose(4.0), "after the end as there");
        assert_eq!(trajectory.pose(f64::NAN), Pose::default());
        assert_eq!(Trajectory::new().pose(1.0), Pose::default());
    }

    #[test]
    fn a_coarser_step_shows_the_same_drive() {
        let vehicle = Vehicle::paper_car();
        let shown = |step: f64| {
            let drive = Drive {
                vehicle: &vehicle,
                effects: effects(),
                commands: &COMMANDS,
                start: Pose::default(),
                step,
            };
            let mut trajectory = Trajectory::new();
            drive.trajectory(10.0, &mut trajectory);
            (0..997).map(|row| trajectory.reference(f64::from(row) * 0.01)).collect::<Vec<_>>()
        };
        for (fine, coarse) in shown(0.001).iter().zip(shown(0.02)) {
            let error = coarse.seen_from(fine);
            assert!(error.x.abs() + error.y.abs() + error.yaw.abs() < 2e-5, "{error:?}");
        }
    }
}
