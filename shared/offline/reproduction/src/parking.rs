//! Row 9: Figure 10 and Table 3 of the paper: a given path, tracked in closed loop by what the vehicle believes.

use kerbside_geometry::{Limits, Pose, Vehicle, angle};
use kerbside_messages::{
    Command as Asked, Mode, Nanos, Permit, Plan, TrackingPhase, TrajectoryPoint,
};
use kerbside_odometry::ParameterPrior;
use kerbside_proving_ground::{
    Actuators, Chassis, Command, Instruments, Leg, Manoeuvre, Pace, Physics, Plant, Residuals,
    Section, Sensors, Slip, TestDrive,
};
use kerbside_tracking::{Tracker, TrackerInputs, TrackerSettings};

use crate::belief::{Knowledge, prior};
use crate::error::ReproductionError;
use crate::figure::{Accept, Figure};
use crate::follower::{Belief, Contender, Follower, reading};
use crate::progress::Progress;
use crate::random::{Random, seed_of};
use crate::statistics::{all, bootstrap, mean, mean_between, quantile, share};

/// Readings, and steps of the loop, per second \[Hz\].
const RATE: f64 = 50.0;
/// Standing before the plan begins \[s\].
const WAIT: f64 = 1.0;
/// Longest drive beyond the plan's duration \[s\].
const LONGEST: f64 = 10.0;
/// How the plans are driven: the digest's.
const PACE: Pace = Pace { speed: 0.1, acceleration: 0.1 };
/// Standard deviations of the start: each axis \[m\], heading \[rad\].
const START: [f64; 2] = [0.02, 2.0 / 180.0 * core::f64::consts::PI];
/// The garage triple of the paper's Table 3: across the digest's slot axis x, y \[m\], heading \[rad\].
const TRIPLE: [f64; 3] = [0.0124, 0.0238, 1.22 / 180.0 * core::f64::consts::PI];
/// The arm under which everything is driven.
const ARM: u64 = 1;

/// A manoeuvre of the digest's section 5.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    /// Forward 35 degrees and in reverse 55 degrees at 0.9 m, then 0.7 m straight; 2.63 m.
    Garage,
    /// A reverse S at 0.9 m with an offset of 0.55 m; 1.86 m.
    Parallel,
}

impl Scene {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Garage, Self::Parallel];

    /// Name, for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Garage => "garage",
            Self::Parallel => "parallel",
        }
    }

    /// What the paper's Table 3 prints for x, y and heading.
    const fn paper(self) -> [&'static str; 3] {
        match self {
            Self::Garage => ["-1.24 cm", "-2.38 cm", "1.22 deg"],
            Self::Parallel => ["-1.75 cm", "+1.12 cm", "0.62 deg"],
        }
    }

    /// The path. The digest does not say how long the straights are in which the curvature rises and falls over 0.15 m:
    /// they are what makes its length the digest's.
    fn manoeuvre(self) -> Manoeuvre {
        const RADIUS: f64 = 0.9;
        const RAMP: f64 = 0.15;
        let arc = |radius: f64, degrees: f64| Section::arc(radius, angle::radians(degrees));
        let legs = match self {
            Self::Garage => {
                let (there, back) = (arc(RADIUS, 35.0), arc(-RADIUS, 55.0));
                let lead = Section::straight((2.63 - 0.7 - there.length - back.length) / 3.0);
                let forward = Leg::new(true, &[lead, there, lead], RAMP);
                vec![forward, Leg::new(false, &[lead, back, Section::straight(0.7)], RAMP)]
            }
            Self::Parallel => {
                // 2 R (1 - cos a) is the offset, but for the ramps.
                let turn =
                    angle::degrees(kerbside_geometry::math::acos(1.0 - 0.55 / (2.0 * RADIUS)));
                let bends = [arc(RADIUS, turn), arc(-RADIUS, turn)];
                let last = Section::straight(0.1 + 0.5 * RAMP);
                let lead = Section::straight(1.86 - 2.0 * bends[0].length - last.length);
                vec![Leg::new(false, &[lead, bends[0], bends[1], last], RAMP)]
            }
        };
        Manoeuvre::path(legs, PACE)
    }
}

/// Who parks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driver {
    /// Believes the truth of the pose.
    Perfect,
    /// Rear wheels alone, with residual errors.
    Rear,
    /// The fused filter, with residual errors.
    Fused,
    /// Rear wheels alone, by what was measured by hand.
    Uncalibrated,
    /// As fused, its tracker not knowing the actuators' lag.
    Lagging,
    /// As fused, its steering's zero off by three times what the prior says.
    Crooked,
    /// As fused, one rear wheel spinning by 30 mm half-way.
    Slipping,
    /// As fused, with ordinary physics.
    Physical,
}

impl Driver {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Perfect,
        Self::Rear,
        Self::Fused,
        Self::Uncalibrated,
        Self::Lagging,
        Self::Crooked,
        Self::Slipping,
        Self::Physical,
    ];

    /// Name, for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Perfect => "perfect pose",
            Self::Rear => "rear",
            Self::Fused => "fused",
            Self::Uncalibrated => "rear, uncalibrated",
            Self::Lagging => "fused, lag not compensated",
            Self::Crooked => "fused, zero off by 0.9 deg",
            Self::Slipping => "fused, 30 mm spin",
            Self::Physical => "fused, with physics",
        }
    }

    const fn contender(self) -> Contender {
        match self {
            Self::Rear | Self::Uncalibrated => Contender::Rear,
            _ => Contender::Fused,
        }
    }
}

/// True ends of many parkings.
#[derive(Clone, Debug, PartialEq)]
pub struct Parkings {
    /// What was driven.
    pub scene: Scene,
    /// By whom.
    pub driver: Driver,
    /// True end in the frame of the goal, x along the slot's axis \[m, m, rad\].
    pub ends: Vec<[f64; 3]>,
    /// In how many the tracker arrived.
    pub arrived: usize,
    /// True path of the first one.
    pub path: Vec<Pose>,
    /// The plan's.
    pub plan: Vec<Pose>,
    seed: u64,
}

/// A plan and its goal.
struct Given {
    head: Plan,
    points: Vec<TrajectoryPoint>,
    goal: Pose,
}

impl Given {
    /// The path of `scene` as a plan: what an ideal car of the paper's measures drives.
    fn new(scene: Scene) -> Self {
        let ideal = TestDrive::new(
            Chassis::paper(),
            Physics::NEUTRAL,
            Sensors::paper(1.0).without_errors(),
            scene.manoeuvre(),
        );
        let states = ideal.record(0).truth;
        let interval = 1.0 / RATE;
        let mut points: Vec<TrajectoryPoint> = states
            .iter()
            .map(|state| TrajectoryPoint {
                time: state.time,
                x: state.pose.x,
                y: state.pose.y,
                yaw: state.pose.yaw,
                speed: state.speed,
                steering: state.steering,
                ..TrajectoryPoint::default()
            })
            .collect();
        for index in 1..points.len() {
            let (before, now) = (points[index - 1], &mut points[index]);
            now.acceleration = (now.speed - before.speed) / interval;
            now.steering_rate = (now.steering - before.steering) / interval;
        }
        let duration = points.last().map_or(0.0, |point| point.time);
        let head = Plan {
            id: 1,
            arm: ARM,
            interval,
            duration,
            points: u32::try_from(points.len()).unwrap_or(0),
            ..Plan::default()
        };
        let goal = states.last().map_or(Pose::default(), |state| state.pose);
        Self { head, points, goal }
    }
}

/// The digest's vehicle, as `chassis` is believed.
fn vehicle(chassis: &Chassis, sensors: &Sensors, knows_lag: bool) -> Vehicle {
    let vehicle = chassis.believed(sensors);
    let steering = Actuators::paper_parking().steering_limit;
    let lag = if knows_lag { 0.1 } else { 0.0 };
    Vehicle {
        limits: Limits { steering, steering_rate: 1.0, ..vehicle.limits },
        actuators: Some(kerbside_geometry::Actuators {
            speed_delay: 0.0,
            speed_lag: lag,
            steering_delay: 0.0,
            steering_lag: lag,
        }),
        ..vehicle
    }
}

/// What is true and believed in one parking.
struct Setting {
    physics: Physics,
    sensors: Sensors,
    slips: Vec<Slip>,
    belief: Belief,
    vehicle: Vehicle,
    contender: Contender,
    perfect: bool,
}

fn setting(driver: Driver, given: &Given, seed: u64) -> Setting {
    let mut random = Random::new(seed);
    let [along, turned] = START;
    let mut drawn = |deviation: f64| deviation * random.normal();
    let start = Pose::new(drawn(along), drawn(along), drawn(turned));
    let mut sensors = Sensors::paper(1.0);
    let residuals = Residuals::paper().draw(seed);
    let zero = match driver {
        Driver::Crooked => 3.0 * Residuals::paper().steering_zero,
        Driver::Perfect | Driver::Uncalibrated => 0.0,
        _ => residuals.steering_zero,
    };
    let believed = match driver {
        Driver::Perfect => Chassis::paper(),
        Driver::Uncalibrated => Chassis {
            track_front: 0.310,
            track_rear: 0.310,
            radius: [0.5 * 0.145; 4],
            ..Chassis::paper()
        },
        _ => residuals.reversed().chassis(&Chassis::paper()),
    };
    let vehicle = vehicle(&believed, &sensors, driver != Driver::Lagging);
    let prior: ParameterPrior = prior(Knowledge::Residual, &sensors);
    if let Some(steering) = &mut sensors.steering {
        steering.offset = zero;
    }
    let half = WAIT + 0.5 * given.head.duration;
    let spins = driver == Driver::Slipping;
    let physics = match driver {
        Driver::Physical => Physics::ordinary(),
        _ => Physics { actuators: Actuators::paper_parking(), ..Physics::NEUTRAL },
    };
    Setting {
        physics,
        slips: spins
            .then(|| Slip::spin(kerbside_geometry::Wheel::RearLeft, 0.03, half, 0.3))
            .into_iter()
            .collect(),
        belief: Belief { vehicle: vehicle.clone(), prior, steering_zero: 0.0, start },
        vehicle,
        sensors,
        contender: driver.contender(),
        perfect: driver == Driver::Perfect,
    }
}

/// The closed loop.
struct Loop<'a> {
    plant: Plant,
    instruments: Instruments,
    follower: Follower,
    tracker: Tracker,
    given: &'a Given,
    perfect: bool,
    mode: Mode,
    command: Asked,
    frame: u32,
}

impl<'a> Loop<'a> {
    fn new(setting: &Setting, given: &'a Given, seed: u64) -> Result<Self, ReproductionError> {
        let chassis = Chassis::paper();
        let start = setting.belief.start;
        Ok(Self {
            plant: Plant::new(&chassis, &setting.physics, start, 0.0),
            instruments: Instruments::new(&chassis, &setting.sensors, &setting.slips, seed),
            follower: Follower::new(setting.contender, &setting.belief)?,
            tracker: Tracker::new(&setting.vehicle, &TrackerSettings::default()),
            given,
            perfect: setting.perfect,
            mode: Mode::Armed,
            command: Asked::default(),
            frame: 0,
        })
    }

    /// A period: drive, read, estimate, track. Whether the tracker is through.
    fn step(&mut self) -> bool {
        let asked = Command { speed: self.command.speed, steering: self.command.steering };
        self.frame += 1;
        let until = f64::from(self.frame) / RATE;
        let duration = until - self.plant.state().time;
        let state = *self.plant.step(duration, asked);
        let counts = self.instruments.counts(&state).unwrap_or_default();
        let steering = self.instruments.steering(&state);
        self.follower.feed(&reading(state.time, self.frame, &counts, steering));
        let mut odometry = self.follower.odometry;
        if self.perfect {
            (odometry.x, odometry.y, odometry.yaw) = (state.pose.x, state.pose.y, state.pose.yaw);
        }
        if state.time < WAIT {
            return false;
        }
        let now: Nanos = odometry.header.stamp;
        let permit = Permit {
            arm: ARM,
            expiry: now + 1_000_000_000,
            mode: self.mode.code(),
            granted: 1,
            ..Permit::default()
        };
        let inputs = TrackerInputs {
            odometry: &odometry,
            plan: Some((&self.given.head, &self.given.points)),
            permit: Some(&permit),
            now,
        };
        if self.tracker.step(inputs, &mut self.command) {
            self.mode = Mode::Driving;
        }
        self.mode == Mode::Driving && self.command.phase != TrackingPhase::Tracking.code()
    }

    /// Until it is through and at rest, or too late; whether it arrived. `path` takes the truth.
    fn run(&mut self, mut path: Option<&mut Vec<Pose>>) -> bool {
        let longest = (WAIT + self.given.head.duration + LONGEST) * RATE;
        while f64::from(self.frame) < longest {
            let through = self.step();
            if let Some(path) = path.as_deref_mut() {
                path.push(self.plant.state().pose);
            }
            if through {
                // What the actuators still do.
                (0..50).for_each(|_| {
                    self.step();
                });
                break;
            }
        }
        self.command.phase == TrackingPhase::Finished.code()
    }
}

fn park(
    scene: Scene,
    driver: Driver,
    (trials, seed): (usize, u64),
    progress: &mut Progress<'_>,
) -> Result<Parkings, ReproductionError> {
    let given = Given::new(scene);
    let mut parkings = Parkings {
        scene,
        driver,
        ends: Vec::new(),
        arrived: 0,
        path: Vec::new(),
        plan: given.points.iter().map(|point| Pose::new(point.x, point.y, point.yaw)).collect(),
        seed: seed_of(seed, 900, u64::MAX),
    };
    for trial in 0..trials {
        // The same errors for every driver: they are compared in pairs.
        let seed = seed_of(seed, 900 + scene as u64, trial as u64);
        let setting = setting(driver, &given, seed);
        let mut closed = Loop::new(&setting, &given, seed)?;
        let path = (trial == 0).then_some(&mut parkings.path);
        let arrived = closed.run(path);
        parkings.arrived += usize::from(arrived);
        let end = closed.plant.state().pose.seen_from(&given.goal);
        parkings.ends.push([end.x, end.y, end.yaw]);
        progress.step()?;
    }
    Ok(parkings)
}

/// Parks both scenes with every driver.
pub(crate) fn park_all(
    trials: usize,
    seed: u64,
    progress: &mut Progress<'_>,
) -> Result<Vec<Parkings>, ReproductionError> {
    let mut lines = Vec::new();
    for scene in Scene::ALL {
        for driver in Driver::ALL {
            lines.push(park(scene, driver, (trials, seed), progress)?);
        }
    }
    Ok(lines)
}

impl Parkings {
    fn column(&self, axis: usize) -> Vec<f64> {
        self.ends.iter().map(|end| end[axis]).collect()
    }

    /// Mean of an error (0 x, 1 y, 2 heading) \[m or rad\].
    #[must_use]
    pub fn mean(&self, axis: usize) -> f64 {
        mean(self.column(axis))
    }

    /// Mean of its magnitude.
    #[must_use]
    pub fn mean_abs(&self, axis: usize) -> f64 {
        mean(self.column(axis).into_iter().map(f64::abs))
    }

    /// Magnitude that 95 % stay below.
    #[must_use]
    pub fn p95(&self, axis: usize) -> f64 {
        quantile(self.column(axis).into_iter().map(f64::abs).collect(), 0.95)
    }

    /// How many ended inside the garage triple of the paper's Table 3.
    #[must_use]
    pub fn inside(&self) -> usize {
        let within = |end: &&[f64; 3]| (0..3).all(|axis| end[axis].abs() <= TRIPLE[axis]);
        self.ends.iter().filter(within).count()
    }

    fn figures(&self) -> Vec<Figure> {
        let held = self.driver == Driver::Fused;
        let only = |accept: Accept| if held { accept } else { Accept::Shown };
        let place = format!("{}, {}", self.scene.name(), self.driver.name());
        let limits = [("x", "mm", 1e3, 5.0), ("y", "mm", 1e3, 8.0), ("heading", "deg", 1.0, 0.55)];
        let mut figures = Vec::new();
        for (axis, (name, unit, scale, limit)) in limits.into_iter().enumerate() {
            let scaled = |value: f64| if axis == 2 { angle::degrees(value) } else { scale * value };
            let values: Vec<f64> =
                self.column(axis).into_iter().map(|value| scaled(value.abs())).collect();
            let (ours, interval) = mean_between(&values, self.seed);
            let accept = only(Accept::AtMost(limit));
            let figure = Figure::new(9, format!("mean |{name}|, {place}"), unit, ours, accept);
            figures.push(figure.between(interval).beside(self.scene.paper()[axis]));
            let p95 = Figure::new(
                9,
                format!("p95 |{name}|, {place}"),
                unit,
                scaled(self.p95(axis)),
                Accept::Shown,
            );
            figures.push(p95);
        }
        let (inside, interval) = share(self.inside(), self.ends.len());
        let accept = match self.driver {
            Driver::Fused => Accept::AtLeast(0.98),
            // It has to fail: calibration is what the paper is about.
            Driver::Uncalibrated => Accept::AtMost(0.02),
            _ => Accept::Shown,
        };
        figures.push(
            Figure::new(9, format!("inside Table 3, {place}"), "", inside, accept)
                .between(interval),
        );
        figures
    }
}

/// The figures of row 9.
pub(crate) fn figures(lines: &[Parkings]) -> Vec<Figure> {
    let mut figures: Vec<Figure> = lines.iter().flat_map(Parkings::figures).collect();
    for scene in Scene::ALL {
        let of = |driver: Driver| {
            let line = lines.iter().find(|line| line.scene == scene && line.driver == driver);
            line.map_or(Vec::new(), |line| line.column(1))
        };
        let (fused, rear) = (of(Driver::Fused), of(Driver::Rear));
        let size =
            |values: &[f64], indices: &[usize]| mean(indices.iter().map(|i| values[*i].abs()));
        let ratio = |indices: &[usize]| size(&fused, indices) / size(&rear, indices);
        let count = fused.len();
        let name = format!("fused/rear mean |y|, {}", scene.name());
        figures.push(
            Figure::new(9, name, "", ratio(&all(count)), Accept::AtMost(0.75))
                .between(bootstrap(count, 9, ratio)),
        );
    }
    figures
}
