//! What moves the body: a motor and a rack, driven by commands or taken from measurements.

use crate::actuator::Actuator;
use crate::plant::Plant;
use crate::play::Play;

/// Motor and rack over a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ahead {
    /// Motor speed in the middle and at the end \[m/s\].
    pub(crate) speed: [f64; 2],
    /// Angle of the rack there \[rad\].
    pub(crate) rack: [f64; 2],
    /// What the source needs to move on: the angle before the play, or the step.
    carried: f64,
}

/// Motor and rack as functions of time, smooth between kinks.
pub(crate) trait Train {
    /// Lets what is due at `now` \[s\] act. Returns whether motor or rack jumped.
    fn begin(&mut self, now: f64) -> bool;
    /// Time of the next kink that is known beforehand \[s\].
    fn next(&self) -> f64;
    /// Longest time over which both are smooth enough for one step \[s\].
    fn smooth(&self) -> f64;
    /// Time until the motor passes through standstill \[s\].
    fn standstill(&self) -> f64;
    /// Motor speed now \[m/s\].
    fn speed(&self) -> f64;
    /// Angle of the rack now \[rad\].
    fn rack(&self) -> f64;
    /// Both after half of `step` \[s\] and after all of it; `step` ends before the next kink.
    fn ahead(&self, step: f64) -> Ahead;
    /// Acceleration of the motor now and at the two instants ahead \[m/s^2\].
    fn acceleration(&self, ahead: &Ahead) -> [f64; 3];
    /// Moves on to the end of what was foretold.
    fn move_to(&mut self, ahead: &Ahead);
}

/// Driven by commands through the actuators.
#[derive(Clone, Debug)]
pub(crate) struct Actuators {
    drive: Actuator,
    steering: Actuator,
    play: Play,
}

impl Actuators {
    /// At rest at zero.
    pub(crate) fn new(plant: &Plant) -> Self {
        Self {
            drive: Actuator::new(&plant.speed),
            steering: Actuator::new(&plant.steering),
            play: Play::new(plant.backlash),
        }
    }

    /// Lets motor and rack be under way at these values, the play's driver where the rack is.
    pub(crate) fn move_on(&mut self, speed: f64, rack: f64) {
        self.drive.move_to(speed);
        self.steering.move_to(rack);
        self.play.move_to(rack);
    }

    /// Takes in a command stamped `time` \[s\]; one that is not finite is left out, as a vehicle
    /// would.
    pub(crate) fn command(&mut self, time: f64, speed: f64, steering: f64) {
        if time.is_finite() && speed.is_finite() && steering.is_finite() {
            self.drive.command(time, speed);
            self.steering.command(time, steering);
        }
    }

    /// The steering command that keeps the rack where it is \[rad\].
    pub(crate) fn holding(&self) -> f64 {
        self.steering.holding()
    }
}

impl Train for Actuators {
    fn begin(&mut self, now: f64) -> bool {
        let jumped = self.drive.begin(now) | self.steering.begin(now);
        let [rack] = self.play.ahead([self.steering.lag().value()]);
        self.play.move_to(rack);
        jumped
    }

    fn next(&self) -> f64 {
        self.drive.next().min(self.steering.next())
    }

    fn smooth(&self) -> f64 {
        self.drive.lag().smooth().min(self.steering.lag().smooth())
    }

    fn standstill(&self) -> f64 {
        self.drive.lag().zero()
    }

    fn speed(&self) -> f64 {
        self.drive.lag().value()
    }

    fn rack(&self) -> f64 {
        self.play.value()
    }

    fn ahead(&self, step: f64) -> Ahead {
        let drivers = self.steering.lag().ahead(step);
        Ahead {
            speed: self.drive.lag().ahead(step),
            rack: self.play.ahead(drivers),
            carried: drivers[1],
        }
    }

    fn acceleration(&self, ahead: &Ahead) -> [f64; 3] {
        self.drive.lag().rates(&ahead.speed)
    }

    fn move_to(&mut self, ahead: &Ahead) {
        self.drive.move_to(ahead.speed[1]);
        self.steering.move_to(ahead.carried);
        self.play.move_to(ahead.rack[1]);
    }
}

/// One value at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// \[s\]
    pub t: f64,
    /// The value.
    pub value: f64,
}

/// Samples joined by straight lines; the first holds before it, the last after it.
#[derive(Clone, Debug)]
struct Series<'a> {
    samples: &'a [Sample],
    /// The first sample that is later than now.
    next: usize,
    now: f64,
}

impl Series<'_> {
    fn begin(&mut self, now: f64) {
        self.now = now;
        while self.samples.get(self.next).is_some_and(|sample| sample.t <= now) {
            self.next += 1;
        }
    }

    fn next(&self) -> f64 {
        self.samples.get(self.next).map_or(f64::INFINITY, |sample| sample.t)
    }

    /// Slope between the samples on both sides of now \[1/s\].
    fn slope(&self) -> f64 {
        match (self.next.checked_sub(1), self.samples.get(self.next)) {
            (Some(before), Some(after)) => {
                let before = self.samples[before];
                (after.value - before.value) / (after.t - before.t)
            }
            _ => 0.0,
        }
    }

    /// The value after `step` \[s\], on this side of the next sample.
    fn ahead(&self, step: f64) -> f64 {
        let Some(before) = self.next.checked_sub(1) else {
            return self.samples.first().map_or(0.0, |first| first.value);
        };
        let before = self.samples[before];
        before.value + self.slope() * (self.now + step - before.t)
    }
}

/// Taken from measurements.
#[derive(Clone, Debug)]
pub(crate) struct Measured<'a> {
    speed: Series<'a>,
    rack: Series<'a>,
}

impl<'a> Measured<'a> {
    /// Motor speed \[m/s\] and rack \[rad\], each in the order of time.
    pub(crate) fn new(speeds: &'a [Sample], racks: &'a [Sample]) -> Self {
        let series = |samples| Series { samples, next: 0, now: 0.0 };
        let mut measured = Self { speed: series(speeds), rack: series(racks) };
        measured.begin(0.0);
        measured
    }
}

impl Train for Measured<'_> {
    fn begin(&mut self, now: f64) -> bool {
        self.speed.begin(now);
        self.rack.begin(now);
        false
    }

    fn next(&self) -> f64 {
        self.speed.next().min(self.rack.next())
    }

    fn smooth(&self) -> f64 {
        f64::INFINITY
    }

    fn standstill(&self) -> f64 {
        let time = -self.speed() / self.speed.slope();
        // Rounding leaves some speed at standstill.
        if time > 1e-9 { time } else { f64::INFINITY }
    }

    fn speed(&self) -> f64 {
        self.speed.ahead(0.0)
    }

    fn rack(&self) -> f64 {
        self.rack.ahead(0.0)
    }

    fn ahead(&self, step: f64) -> Ahead {
        let both = |series: &Series<'_>| [series.ahead(0.5 * step), series.ahead(step)];
        Ahead { speed: both(&self.speed), rack: both(&self.rack), carried: step }
    }

    fn acceleration(&self, _: &Ahead) -> [f64; 3] {
        [self.speed.slope(); 3]
    }

    fn move_to(&mut self, ahead: &Ahead) {
        self.speed.now += ahead.carried;
        self.rack.now += ahead.carried;
    }
}
