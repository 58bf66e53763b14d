//! The closed loop: car, a perfect estimator, the tracker.

use kerbside_geometry::{Pose, Vehicle};
use kerbside_messages::{Command, Mode, Odometry, TrackingPhase, TrackingStop};
use kerbside_tracking::{Tracker, TrackerInputs, TrackerSettings};

use crate::car::Car;
use crate::scene::{ARM, Scene, odometry, permit, stamp};

const PERIOD: f64 = 0.005;
/// Travel between two counts.
const COUNT: f64 = 0.0002;
const STANDSTILL: f64 = 0.3;

pub(crate) struct Loop {
    pub(crate) car: Car,
    pub(crate) tracker: Tracker,
    pub(crate) scene: Scene,
    pub(crate) mode: Mode,
    pub(crate) command: Command,
    /// Every command sent.
    pub(crate) sent: Vec<Command>,
    still: (f64, Pose),
}

impl Loop {
    pub(crate) fn new(vehicle: &Vehicle, scene: Scene, start: Pose) -> Self {
        Self {
            car: Car::new(vehicle, start),
            tracker: Tracker::new(vehicle, &TrackerSettings::default()),
            scene,
            mode: Mode::Armed,
            command: Command::default(),
            sent: Vec::new(),
            still: (-1.0, start),
        }
    }

    /// One period; `alter` may change the estimate. Whether a command was sent.
    pub(crate) fn step(&mut self, alter: impl Fn(&mut Odometry)) -> bool {
        let time = self.car.time + PERIOD;
        self.car.advance(time);
        let standstill = self.stands();
        let mut odometry = odometry(time, &self.car.pose, standstill);
        alter(&mut odometry);
        let permit = permit(time, ARM, self.mode);
        let inputs = TrackerInputs {
            odometry: &odometry,
            plan: Some((&self.scene.plan, &self.scene.points)),
            permit: Some(&permit),
            now: stamp(time + 0.001),
        };
        let sent = self.tracker.step(inputs, &mut self.command);
        if sent {
            self.mode = Mode::Driving;
            self.sent.push(self.command);
            self.car.command(self.command.speed, self.command.steering);
        }
        sent
    }

    /// Until the tracker is through with the plan.
    pub(crate) fn run(&mut self, alter: impl Fn(&mut Odometry)) -> (TrackingPhase, TrackingStop) {
        for _ in 0..20_000 {
            self.step(&alter);
            if self.command.phase != TrackingPhase::Tracking.code() && !self.sent.is_empty() {
                return self.verdict();
            }
        }
        panic!("the plan never ends: {:?}", self.command);
    }

    pub(crate) fn verdict(&self) -> (TrackingPhase, TrackingStop) {
        let phase = TrackingPhase::from_code(self.command.phase).expect("a phase");
        (phase, TrackingStop::from_code(self.command.stop).expect("a reason"))
    }

    /// True pose seen from the goal.
    pub(crate) fn miss(&self) -> Pose {
        self.car.pose.seen_from(&self.scene.goal)
    }

    /// Whether no count fell for a while.
    fn stands(&mut self) -> bool {
        let (since, at) = self.still;
        if self.car.pose.distance(&at) > COUNT {
            self.still = (self.car.time, self.car.pose);
        }
        self.car.time - since >= STANDSTILL
    }
}
