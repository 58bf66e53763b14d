//! The two scenarios, and an oracle that knows nothing of how the planner measures.

#![allow(dead_code)] // each test file uses a part

use kerbside_geometry::{Footprint, Limits, Pose, Vehicle, math};
use kerbside_messages::{PlanRequest, TrajectoryPoint};
use kerbside_planning::{PlanFailure, Planned, PlannerSettings, Segment, plan};

/// A box along the axes: least x, y, greatest x, y.
pub(crate) type Block = [f64; 4];

/// A vehicle among boxes.
#[derive(Clone)]
pub(crate) struct Scene {
    pub(crate) vehicle: Vehicle,
    pub(crate) start: Pose,
    pub(crate) request: PlanRequest,
    pub(crate) blocks: Vec<Block>,
}

impl Scene {
    pub(crate) fn plan(&self) -> Result<Planned, PlanFailure> {
        plan(&self.vehicle, &PlannerSettings::default(), self.start, &self.request, &mut |_| ())
    }

    pub(crate) fn with_blocks(mut self, blocks: &[Block]) -> Self {
        self.request.sizes = [0; 32];
        for [left, low, right, high] in blocks.iter().copied() {
            let corners = [[left, low], [right, low], [right, high], [left, high]];
            assert!(self.request.push_obstacle(&corners));
        }
        self.blocks = blocks.to_vec();
        self
    }

    pub(crate) fn started_at(mut self, x: f64, y: f64, yaw: f64) -> Self {
        self.start = Pose::new(x, y, yaw);
        self
    }

    /// The start moved within 5 cm per 0.75 m of length, and 5 degrees, corners of that box first.
    pub(crate) fn disturbed(mut self, number: i32) -> Self {
        let scale = self.vehicle.footprint.length / 0.75;
        let bit = |i: i32| if number >> i & 1 == 0 { 1.0 } else { -1.0 };
        let phase = f64::from(number);
        let shares = if number < 8 {
            [bit(0), bit(1), bit(2)]
        } else {
            [math::sin(7.1 * phase), math::sin(3.7 * phase), math::sin(5.3 * phase)]
        };
        self.start.x += 0.05 * scale * shares[0];
        self.start.y += 0.05 * scale * shares[1];
        self.start.yaw += 5_f64.to_radians() * shares[2];
        self
    }

    /// All lengths times `scale`, for another vehicle.
    pub(crate) fn scaled(mut self, scale: f64, vehicle: Vehicle, speed: f64) -> Self {
        let blocks: Vec<Block> =
            self.blocks.iter().map(|block| block.map(|side| side * scale)).collect();
        self.start = Pose::new(self.start.x * scale, self.start.y * scale, self.start.yaw);
        let request = &mut self.request;
        (request.x, request.y) = (request.x * scale, request.y * scale);
        (request.clearance, request.speed) = (request.clearance * scale, speed);
        request.bounds = request.bounds.map(|side| side * scale);
        self.vehicle = vehicle;
        self.with_blocks(&blocks)
    }

    /// The scene in a mirror along the aisle.
    pub(crate) fn mirrored(mut self) -> Self {
        let flip = |[left, low, right, high]: Block| [left, -high, right, -low];
        let blocks: Vec<Block> = self.blocks.iter().map(|block| flip(*block)).collect();
        self.start = Pose::new(self.start.x, -self.start.y, -self.start.yaw);
        (self.request.y, self.request.yaw) = (-self.request.y, -self.request.yaw);
        self.request.bounds = flip(self.request.bounds);
        self.with_blocks(&blocks)
    }
}

pub(crate) fn small_car() -> Vehicle {
    Vehicle::paper_car()
}

/// A full-size car of that wheelbase, length, width and rear overhang.
pub(crate) fn full_size(wheelbase: f64, length: f64, width: f64, rear_overhang: f64) -> Vehicle {
    Vehicle {
        wheelbase,
        footprint: Footprint { length, width, rear_overhang },
        limits: Limits {
            speed: 2.0,
            acceleration: 1.0,
            deceleration: 1.0,
            steering: 0.56,
            steering_rate: 0.5,
        },
        ..small_car()
    }
}

fn scene(start: Pose, goal: Pose, clearance: f64, gear: i8, gear_changes: u32) -> Scene {
    let request = PlanRequest {
        id: 7,
        arm: 3,
        x: goal.x,
        y: goal.y,
        yaw: goal.yaw,
        clearance,
        steering: 28_f64.to_radians(),
        speed: 0.2,
        gear,
        gear_changes,
        ..PlanRequest::default()
    };
    Scene { vehicle: small_car(), start, request, blocks: Vec::new() }
}

/// The garage, its slot so wide.
pub(crate) fn garage_of(width: f64) -> Scene {
    let goal = Pose::new(0.0, -0.72, core::f64::consts::FRAC_PI_2);
    let mut scene = scene(Pose::new(-1.0, 0.65, 0.0), goal, 0.05, -1, 1);
    scene.request.bounds = [-2.0, -0.95, 2.5, 1.3];
    scene.with_blocks(&[[-2.0, -0.95, -0.5 * width, 0.0], [0.5 * width, -0.95, 2.5, 0.0]])
}

/// The parallel slot, so long.
pub(crate) fn parallel_of(length: f64) -> Scene {
    let goal = Pose::new(0.3175, -0.26, 0.0);
    let mut scene = scene(Pose::new(-0.6, 0.45, 0.0), goal, 0.03, 0, 4);
    scene.request.bounds = [-2.0, -0.82, 2.5, 1.3];
    let below = [-2.0, -0.82, 2.5, -0.52];
    scene.with_blocks(&[[-2.0, -0.52, 0.0, 0.0], [length, -0.52, 2.5, 0.0], below])
}

pub(crate) fn garage() -> Scene {
    garage_of(0.52)
}

pub(crate) fn parallel() -> Scene {
    parallel_of(1.125)
}

/// Clearance of the footprint at a pose, from points and boxes alone; 0 where it overlaps.
pub(crate) fn clearance_at(scene: &Scene, pose: &Pose) -> f64 {
    let car = &scene.vehicle.footprint;
    let own =
        [-car.rear_overhang, -0.5 * car.width, car.length - car.rear_overhang, 0.5 * car.width];
    let (sin, cos) = math::sin_cos(pose.yaw);
    let outward = |[x, y]: [f64; 2]| [pose.x + cos * x - sin * y, pose.y + sin * x + cos * y];
    let inward = |[x, y]: [f64; 2]| {
        let (x, y) = (x - pose.x, y - pose.y);
        [cos * x + sin * y, cos * y - sin * x]
    };
    let bounds = scene.request.bounds;
    let mut least = f64::INFINITY;
    for [x, y] in corners(own).map(outward) {
        least = least.min(x - bounds[0]).min(y - bounds[1]);
        least = least.min(bounds[2] - x).min(bounds[3] - y);
    }
    for block in &scene.blocks {
        for corner in corners(own) {
            least = least.min(to_box(outward(corner), *block));
        }
        for corner in corners(*block) {
            least = least.min(to_box(inward(corner), own));
        }
    }
    least
}

fn corners([left, low, right, high]: Block) -> [[f64; 2]; 4] {
    [[left, low], [right, low], [right, high], [left, high]]
}

fn to_box([x, y]: [f64; 2], [left, low, right, high]: Block) -> f64 {
    let out = |value: f64, least: f64, most: f64| (least - value).max(value - most).max(0.0);
    math::hypot(out(x, left, right), out(y, low, high))
}

/// Everything that has to hold of a plan for a scene.
pub(crate) fn check(scene: &Scene, planned: &Planned) {
    let (head, request) = (&planned.head, &scene.request);
    assert_eq!(head.validate_points(&planned.points), Ok(()));
    assert_eq!((head.id, head.arm), (request.id, request.arm));
    assert!(head.gear_changes <= request.gear_changes, "{} gear changes", head.gear_changes);
    assert!(head.clearance >= request.clearance, "clearance {}", head.clearance);
    check_ends(scene, planned);
    check_limits(scene, planned);
    check_motion(scene, &planned.points);
    check_gears(scene, planned);
    check_settled(scene, planned);
    check_clearance(scene, planned);
}

fn check_ends(scene: &Scene, planned: &Planned) {
    let (first, last) = (planned.points[0], planned.points[planned.points.len() - 1]);
    assert_eq!((first.time, first.speed, first.steering), (0.0, 0.0, 0.0));
    assert_eq!(Pose::new(first.x, first.y, first.yaw), scene.start);
    assert_eq!((last.x, last.y, last.speed), (scene.request.x, scene.request.y, 0.0));
    let goal = Pose::new(scene.request.x, scene.request.y, scene.request.yaw);
    assert!(Pose::new(last.x, last.y, last.yaw).seen_from(&goal).yaw.abs() < 1e-12);
    let end = planned.path.last().map_or(scene.start, Segment::end);
    assert!(end.distance(&goal) < 1e-9 && (end.yaw - last.yaw).abs() < 1e-9, "{end:?}");
    assert!((last.time - planned.head.duration).abs() < 1e-12);
}

fn check_limits(scene: &Scene, planned: &Planned) {
    let (limits, request) = (&scene.vehicle.limits, &scene.request);
    for point in &planned.points {
        assert!(point.speed.abs() <= request.speed);
        let slows = point.acceleration * point.speed < 0.0;
        let most = if slows { 0.5 * limits.deceleration } else { 0.5 * limits.acceleration };
        assert!(point.acceleration.abs() <= most);
        assert!(point.steering.abs() <= request.steering);
        assert!(point.steering_rate.abs() <= 0.8 * limits.steering_rate);
        assert!(point.speed == 0.0 || point.steering_rate == 0.0, "steers while it drives");
        assert!(point.steering.abs() <= planned.head.steering);
        assert!(point.speed.abs() <= planned.head.speed);
    }
}

/// The pose is the integral of speed and steering, and these are the integrals of their rates.
fn check_motion(scene: &Scene, points: &[TrajectoryPoint]) {
    let mut pose = scene.start;
    let scale = scene.vehicle.wheelbase / 0.5;
    for pair in points.windows(2) {
        let h = pair[1].time - pair[0].time;
        for step in 0..8 {
            let share = (f64::from(step) + 0.5) / 8.0;
            let speed = pair[0].speed + share * (pair[1].speed - pair[0].speed);
            let steering = pair[0].steering + share * (pair[1].steering - pair[0].steering);
            let distance = speed * h / 8.0;
            pose = pose.advance(distance, distance * math::tan(steering) / scene.vehicle.wheelbase);
        }
        let there = Pose::new(pair[1].x, pair[1].y, pair[1].yaw);
        assert!(pose.distance(&there) < 2e-4 * scale, "at {}: {pose:?} {there:?}", pair[1].time);
        assert!((pose.yaw - there.yaw).abs() < 2e-4, "at {}", pair[1].time);
        let gained = 0.5 * h * (pair[0].acceleration + pair[1].acceleration);
        assert!((pair[1].speed - pair[0].speed - gained).abs() < 2e-3 * scale);
        let steered = 0.5 * h * (pair[0].steering_rate + pair[1].steering_rate);
        assert!((pair[1].steering - pair[0].steering - steered).abs() < 1e-3);
    }
}

/// Changes of direction are as many as stated and take their pause; the last is as asked.
fn check_gears(scene: &Scene, planned: &Planned) {
    let mut moved: Option<TrajectoryPoint> = None;
    let mut changes = 0;
    for point in planned.points.iter().filter(|point| point.speed != 0.0) {
        if let Some(before) = moved.filter(|before| before.speed * point.speed < 0.0) {
            changes += 1;
            let stood = point.time - before.time;
            assert!(stood >= PlannerSettings::default().pause, "{stood} s");
        }
        moved = Some(*point);
    }
    assert_eq!(changes, planned.head.gear_changes);
    let arrives = moved.map_or(0.0, |point| point.speed) * f64::from(scene.request.gear);
    assert!(arrives > 0.0 || scene.request.gear == 0);
}

/// Between the steering's last movement and the car's next, the wheels have time to follow.
fn check_settled(scene: &Scene, planned: &Planned) {
    let response = scene.vehicle.response();
    let settle = response.steering_delay + 3.0 * response.steering_lag;
    let mut steered: Option<f64> = None;
    for point in &planned.points {
        if point.steering_rate != 0.0 {
            steered = Some(point.time);
        } else if point.speed != 0.0
            && let Some(before) = steered.take()
        {
            assert!(point.time - before >= settle, "{} s at {}", point.time - before, point.time);
        }
    }
}

/// The certificate holds at every point and between, and is not far below what is found there.
fn check_clearance(scene: &Scene, planned: &Planned) {
    let mut least = f64::INFINITY;
    for pair in planned.points.windows(2) {
        for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let mix = |a: f64, b: f64| a + share * (b - a);
            let pose = Pose::new(
                mix(pair[0].x, pair[1].x),
                mix(pair[0].y, pair[1].y),
                mix(pair[0].yaw, pair[1].yaw),
            );
            least = least.min(clearance_at(scene, &pose));
        }
    }
    let (stated, scale) = (planned.head.clearance, scene.vehicle.wheelbase / 0.5);
    assert!(least >= stated - 1e-4 * scale, "{least} m found, {stated} m stated");
    assert!(least <= stated + 1e-3 * scale, "{least} m found, {stated} m stated");
}
