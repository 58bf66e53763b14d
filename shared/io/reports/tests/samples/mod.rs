//! Made-up runs that look like real ones: for tests, and for looking at.

mod diagnosed;

pub(crate) use diagnosed::{ambiguous, diagnosed, mistaken, no_gap, unknown};
use kerbside_geometry::{Footprint, Pose, Wheel, math};
use kerbside_reports::svg::Tone;
use kerbside_reports::{
    CalibrateReport, CalibratedParameter, CommandSample, DerivedFigure, Drift, EndErrors,
    EstimateSample, Event, EventKind, Figures, Gap, JudgedOn, Latency, Model, Motion, Outcome,
    ParkReport, Phase, Plan, ProcessFigures, Provenance, ReckonedPath, RefusalCount, ReplayReport,
    RunNote, RunPaths, RunResidual, Scene, WheelTravel,
};

const WHEELBASE: f64 = 0.5;
const SPEED: f64 = 0.2;
const START: f64 = 1.0;

/// A small generator of numbers in -1..1, equal on every machine.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// The pose and the steering angle after a share of a stretch.
type Stretch = (f64, fn(f64) -> (Pose, f64));

const RADIUS: f64 = 0.94;

/// Forward in a gentle S, then back along a quarter circle and straight into the slot.
const STRETCHES: [(i32, &[Stretch]); 2] = [
    (
        1,
        &[(1.97, |share| {
            let y = 0.65 + 0.29 * share * share * (3.0 - 2.0 * share);
            let slope = 0.29 * 6.0 * share * (1.0 - share) / 1.94;
            let bend = 0.29 * (6.0 - 12.0 * share) / (1.94 * 1.94);
            (Pose::new(-1.0 + 1.94 * share, y, math::atan(slope)), math::atan(WHEELBASE * bend))
        })],
    ),
    (
        -1,
        &[
            (RADIUS * core::f64::consts::FRAC_PI_2, |share| {
                let yaw = share * core::f64::consts::FRAC_PI_2;
                let (sin, cos) = math::sin_cos(yaw);
                (
                    Pose::new(RADIUS * (1.0 - sin), RADIUS * cos, yaw),
                    -math::atan(WHEELBASE / RADIUS),
                )
            }),
            (0.72, |share| (Pose::new(0.0, -0.72 * share, core::f64::consts::FRAC_PI_2), 0.0)),
        ],
    ),
];

/// A trapezoid of speed over each direction of travel, sampled every 20 ms.
fn plan() -> Vec<Motion> {
    let mut points = Vec::new();
    let mut time = START;
    for (sign, stretches) in STRETCHES {
        let length: f64 = stretches.iter().map(|stretch| stretch.0).sum();
        let mut rolled = 0.0;
        while rolled < length {
            let speed =
                SPEED.min((0.3 * rolled + 2e-5).sqrt()).min((0.3 * (length - rolled)).sqrt());
            let (pose, steering) = along(stretches, rolled);
            points.push(Motion { time, pose, speed: f64::from(sign) * speed, steering });
            rolled += speed.max(0.002) * 0.02;
            time += 0.02;
        }
        let (pose, steering) = along(stretches, length);
        for _ in 0..40 {
            points.push(Motion { time, pose, speed: 0.0, steering });
            time += 0.02;
        }
    }
    points
}

fn along(stretches: &[Stretch], mut rolled: f64) -> (Pose, f64) {
    for (length, at) in &stretches[..stretches.len() - 1] {
        if rolled <= *length {
            return at(rolled / length);
        }
        rolled -= length;
    }
    let (length, at) = stretches[stretches.len() - 1];
    at((rolled / length).min(1.0))
}

/// What was driven: the plan, with an initial error that dies away, and a little noise.
fn truth(plan: &[Motion]) -> Vec<Motion> {
    let mut noise = Noise(7);
    let mut wander = [0.0_f64; 3];
    plan.iter()
        .enumerate()
        .map(|(index, point)| {
            let left = math::exp(-f64::from(index as u32) / 160.0);
            for value in &mut wander {
                *value = 0.995 * *value + 2e-4 * noise.next();
            }
            let offset = Pose::new(
                0.03 * left + wander[0],
                -0.035 * left + wander[1],
                0.05 * left + 0.8 * wander[2],
            );
            let lag = &plan[index.saturating_sub(6)];
            let pose = point.pose.compose(&offset);
            Motion { time: point.time, pose, speed: lag.speed, steering: lag.steering }
        })
        .collect()
}

fn estimate(truth: &[Motion]) -> Vec<EstimateSample> {
    let mut noise = Noise(11);
    let (mut drift, mut rolled) = (Pose::new(0.0015, -0.001, 0.001), 0.0);
    truth
        .iter()
        .map(|motion| {
            rolled += motion.speed.abs() * 0.02;
            let step = 1.2e-4 * motion.speed.abs() / SPEED;
            drift.x += step * noise.next();
            drift.y += step * noise.next();
            drift.yaw += 1.6 * step * noise.next();
            let (position, heading) = (4e-6 + 1.6e-6 * rolled, 3e-6 + 2.4e-6 * rolled);
            let covariance = [
                position,
                0.3 * position,
                0.0,
                0.3 * position,
                0.7 * position,
                0.0,
                0.0,
                0.0,
                heading,
            ];
            let pose = motion.pose.compose(&drift);
            EstimateSample { motion: Motion { pose, ..*motion }, covariance }
        })
        .collect()
}

fn commands(plan: &[Motion], estimate: &[EstimateSample]) -> Vec<CommandSample> {
    let command = |(point, sample): (&Motion, &EstimateSample)| {
        let error = sample.motion.pose.inverse().compose(&point.pose);
        CommandSample {
            time: point.time,
            speed: point.speed + 0.6 * error.x * point.speed.abs() / SPEED,
            steering: (point.steering + 1.5 * error.y + 0.6 * error.yaw).clamp(-0.52, 0.52),
            error_along: error.x,
            error_across: error.y,
            error_yaw: error.yaw,
        }
    };
    plan.iter().zip(estimate).map(command).collect()
}

fn latency() -> Latency {
    let mut noise = Noise(3);
    let mut counts: Vec<_> = (0..5200)
        .map(|_| {
            let spread: f64 = (0..4).map(|_| noise.next()).sum();
            (58e-6 * math::exp(0.16 * spread), 1)
        })
        .collect();
    counts.extend((0..60).map(|_| (240e-6 * math::exp(0.8 * noise.next()), 1)));
    counts.extend([(1.9e-3, 2), (3.7e-3, 1)]);
    let mut times: Vec<f64> = counts.iter().map(|entry| entry.0).collect();
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    Latency {
        p50: at(0.5),
        p99: at(0.99),
        p999: at(0.999),
        max: at(1.0),
        deadline: Some(0.05),
        counts,
    }
}

fn scene() -> Scene {
    let rectangle =
        |x0: f64, y0: f64, x1: f64, y1: f64| vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
    Scene {
        bounds: [-2.0, -0.95, 2.5, 1.3],
        obstacles: vec![
            rectangle(-2.5, -1.4, -0.26, 0.0),
            rectangle(0.26, -1.4, 3.0, 0.0),
            rectangle(-0.26, -1.4, 0.26, -0.95),
            rectangle(-2.5, 1.3, 3.0, 1.8),
        ],
        slot: rectangle(-0.26, -0.95, 0.26, 0.0),
        start: Pose::new(-1.0, 0.65, 0.0),
        goal: Pose::new(0.0, -0.72, core::f64::consts::FRAC_PI_2),
        tolerance: Pose::new(0.03, 0.03, 1.5_f64.to_radians()),
        footprint: Footprint { length: 0.75, width: 0.37, rear_overhang: 0.13 },
    }
}

fn provenance(command: &str) -> Provenance {
    Provenance {
        version: "0.1.0".to_owned(),
        seed: Some(42),
        command_line: command.to_owned(),
        configuration: vec!["config/stack.toml".into(), "config/vehicles/paper-1-6.toml".into()],
        instance: "kerbside-3f81".to_owned(),
        recording: "~/.local/state/kerbside/runs/garage-42/garage.mcap".to_owned(),
        machine: vec![
            ("Processor".to_owned(), "2 cores".to_owned()),
            ("Real-time rights".to_owned(), "no".to_owned()),
        ],
    }
}

fn phases(end: f64) -> Vec<Phase> {
    let phase = |start, end, mode: &str, tone| Phase { start, end, mode: mode.to_owned(), tone };
    vec![
        phase(0.0, 0.4, "ready", Tone::Plain),
        phase(0.4, START, "armed", Tone::Warn),
        phase(START, end, "driving", Tone::Good),
        phase(end, end + 0.8, "done", Tone::Plain),
    ]
}

fn events(end: f64) -> Vec<Event> {
    let event = |time, kind, text: &str| Event { time, kind, text: text.to_owned() };
    vec![
        event(0.0, EventKind::Mode, "starting \u{2192} ready"),
        event(0.2, EventKind::Note, "fix accepted at standstill"),
        event(0.4, EventKind::Arm, "armed by the operator, arm 1"),
        event(0.912, EventKind::Plan, "plan 1: 4.17 m, 1 gear change, clearance 53.2 mm"),
        event(START, EventKind::Mode, "armed \u{2192} driving"),
        event(end, EventKind::Mode, "driving \u{2192} done: plan completed"),
    ]
}

fn processes() -> Vec<ProcessFigures> {
    let names = ["interface", "ingest", "estimator", "planner", "tracker", "actuation", "recorder"];
    let row = |(index, name): (usize, &&str)| ProcessFigures {
        name: (*name).to_owned(),
        pid: Some(41_200 + 3 * index as u32),
        restarts: 0,
        misses: 0,
        work_mean: (3.0 + 2.1 * index as f64) * 1e-6,
        work_max: (30.0 + 61.0 * index as f64) * 1e-6,
    };
    names.iter().enumerate().map(row).collect()
}

/// A garage manoeuvre that ends well.
pub(crate) fn parked() -> ParkReport {
    let plan = plan();
    let truth = truth(&plan);
    let estimate = estimate(&truth);
    let end = plan.last().map_or(0.0, |point| point.time);
    let scene = scene();
    let last = truth.last().map_or(scene.start, |motion| motion.pose);
    let estimated = estimate.last().map_or(scene.start, |sample| sample.motion.pose);
    ParkReport {
        scenario: "garage".to_owned(),
        vehicle: "paper-1-6".to_owned(),
        run: "Seven processes on shared memory, simulated vehicle".to_owned(),
        outcome: Outcome {
            parked: true,
            collision: false,
            cause: None,
            judged_on: JudgedOn::Truth,
        },
        figures: Figures {
            end_error: Some(last.seen_from(&scene.goal)),
            estimate_error: Some(estimated.seen_from(&last)),
            gear_changes: 1,
            duration: end - START,
            path_length: 4.17,
            planned_clearance: Some(0.0532),
            driven_clearance: Some(0.0487),
            deadline_misses: 0,
            restarts: 0,
        },
        scene,
        latency: Some(latency()),
        commands: commands(&plan, &estimate),
        plans: vec![Plan { points: plan }],
        estimate,
        truth,
        phases: phases(end),
        events: events(end),
        processes: processes(),
        provenance: provenance("kerbside park garage --seed 42"),
    }
}

/// The same manoeuvre, broken off by the death of a process, with text that wants to be markup.
pub(crate) fn broken_off() -> ParkReport {
    let mut report = parked();
    let stop = 9.0;
    report.truth.retain(|motion| motion.time < stop + 1.0);
    report.estimate.retain(|sample| sample.motion.time < stop);
    report.commands.retain(|command| command.time < stop);
    report.scenario = "garage <b>&\"'</b>".to_owned();
    report.outcome = Outcome {
        parked: false,
        collision: true,
        cause: Some("estimator died </p><script>alert(1)</script>".to_owned()),
        judged_on: JudgedOn::Truth,
    };
    let last = report.truth.last().map_or(report.scene.start, |motion| motion.pose);
    report.figures.end_error = Some(last.seen_from(&report.scene.goal));
    report.figures.driven_clearance = Some(-0.002);
    (report.figures.restarts, report.figures.deadline_misses) = (1, 4);
    let phase = |start, end, mode: &str, tone| Phase { start, end, mode: mode.to_owned(), tone };
    report.phases = vec![
        phase(0.0, START, "armed", Tone::Warn),
        phase(START, stop, "driving", Tone::Good),
        phase(stop, stop + 1.0, "stopping", Tone::Warn),
        phase(stop + 1.0, stop + 3.0, "faulted", Tone::Bad),
    ];
    let event = |time, kind, text: &str| Event { time, kind, text: text.to_owned() };
    report.events.truncate(5);
    report.events.extend([
        event(stop, EventKind::Fault, "estimator (pid 41206) died: signal 9"),
        event(stop + 0.1, EventKind::Restart, "estimator restarted, pid 41250\u{0}\u{1b}[31m"),
    ]);
    report
}

/// Nothing was recorded and nothing is known.
pub(crate) fn empty() -> ParkReport {
    let unknown = Pose::new(f64::NAN, f64::NAN, f64::NAN);
    ParkReport {
        scenario: String::new(),
        vehicle: String::new(),
        run: String::new(),
        outcome: Outcome {
            parked: false,
            collision: false,
            cause: None,
            judged_on: JudgedOn::Estimate,
        },
        scene: Scene {
            bounds: [f64::NAN; 4],
            obstacles: vec![Vec::new(), vec![[f64::NAN, 0.0]]],
            slot: Vec::new(),
            start: unknown,
            goal: unknown,
            tolerance: unknown,
            footprint: Footprint { length: f64::NAN, width: f64::NAN, rear_overhang: f64::NAN },
        },
        figures: Figures {
            end_error: None,
            estimate_error: None,
            gear_changes: 0,
            duration: f64::NAN,
            path_length: f64::NAN,
            planned_clearance: None,
            driven_clearance: Some(f64::NAN),
            deadline_misses: 0,
            restarts: 0,
        },
        latency: None,
        plans: vec![Plan { points: Vec::new() }],
        estimate: Vec::new(),
        truth: Vec::new(),
        commands: Vec::new(),
        phases: Vec::new(),
        events: Vec::new(),
        processes: Vec::new(),
        provenance: Provenance::default(),
    }
}

/// Samples are there, but nothing in them is a number.
pub(crate) fn not_numbers() -> ParkReport {
    let mut report = parked();
    let nan = f64::NAN;
    for motion in &mut report.truth {
        motion.pose = Pose::new(nan, f64::INFINITY, nan);
        (motion.speed, motion.steering) = (nan, f64::NEG_INFINITY);
    }
    for sample in &mut report.estimate {
        sample.covariance = [nan; 9];
        sample.motion.pose.x = 1e300;
    }
    for command in &mut report.commands {
        (command.speed, command.error_along) = (nan, f64::MAX);
    }
    for point in &mut report.plans[0].points {
        point.time = nan;
    }
    report.figures.end_error = Some(Pose::new(nan, nan, nan));
    report.latency =
        Some(Latency { p50: nan, p99: nan, p999: nan, max: nan, deadline: None, counts: vec![] });
    report
}

/// A drive around a block, with a gap.
pub(crate) fn replayed() -> ReplayReport {
    let (mut odometry, mut reference, mut fl, mut rr) = (vec![], vec![], vec![], vec![]);
    let (mut pose, mut rolled) = (Pose::default(), 0.0);
    for index in 0..12_000_u32 {
        let time = f64::from(index) * 0.01;
        let bend = if (index / 1500) % 2 == 0 { 0.0 } else { 0.105 };
        let speed = 2.0 + 0.6 * math::sin(time * 0.3);
        pose = pose.advance(speed * 0.01, speed * 0.01 * bend);
        rolled += speed * 0.01;
        let motion = Motion { time, pose, speed, steering: bend };
        reference.push(motion);
        let drift = Pose::new(-0.004 * rolled, 0.0021 * rolled, 0.000_12 * rolled);
        odometry.push(Motion { pose: drift.compose(&pose), ..motion });
        let in_gap = (4000..4300).contains(&index);
        fl.push([time, if in_gap { f64::NAN } else { rolled * 1.004 }]);
        rr.push([time, if in_gap { f64::NAN } else { rolled * 0.991 }]);
    }
    let (last, truth) = (odometry[11_999].pose, reference[11_999].pose);
    let end_error = last.seen_from(&truth);
    ReplayReport {
        input: "runs/block-1".to_owned(),
        vehicle: "delivery van".to_owned(),
        mode: "through running processes at 20 times real time".to_owned(),
        problem: None,
        caution: None,
        duration: 120.0,
        distance: rolled,
        samples: 12_000,
        speed_factor: 20.4,
        odometry_sha256: "9f".repeat(32),
        model: Model {
            name: "rear wheels".to_owned(),
            uses: vec!["rl and rr counts".to_owned(), "gyro".to_owned()],
            missing: vec![
                "No front encoders: the rear odometry is not corrected by a front one.".to_owned(),
                "No steering sensor: the front odometry cannot be formed.".to_owned(),
            ],
        },
        odometry,
        reference,
        drift: Some(Drift {
            position_percent: 100.0 * truth.distance(&last) / rolled,
            heading_per_metre: end_error.yaw / rolled,
            end_error,
            basis: "Medians over 87 windows of 27.1 m.".to_owned(),
        }),
        travel: vec![
            WheelTravel { wheel: Wheel::RearLeft, points: fl },
            WheelTravel { wheel: Wheel::RearRight, points: rr },
        ],
        gaps: vec![Gap { start: 40.0, end: 43.0, text: "rl and rr were not read".to_owned() }],
        refusals: vec![RefusalCount { reason: "stamp not increasing".to_owned(), count: 3 }],
        notes: vec!["encoders.csv: column temperature not used".to_owned()],
        provenance: provenance("kerbside replay runs/block-1 --speed 20"),
    }
}

/// A drive that was refused.
pub(crate) fn refused() -> ReplayReport {
    ReplayReport {
        problem: Some("no wheel reports & nothing else moves <it>".to_owned()),
        duration: f64::NAN,
        distance: f64::NAN,
        samples: 0,
        speed_factor: f64::NAN,
        odometry_sha256: String::new(),
        model: Model::default(),
        odometry: Vec::new(),
        reference: Vec::new(),
        drift: None,
        travel: Vec::new(),
        gaps: Vec::new(),
        refusals: Vec::new(),
        notes: Vec::new(),
        ..replayed()
    }
}

/// A calibration from three runs, one of which was rejected.
pub(crate) fn calibrated() -> CalibrateReport {
    let arc = |bend: f64| -> Vec<[f64; 2]> {
        let at = |step: u32| {
            Pose::default().advance(0.05 * f64::from(step), 0.05 * bend * f64::from(step))
        };
        (0..100).map(at).map(|pose| [pose.x, pose.y]).collect()
    };
    let ends = |run: &str, source: &str, yaw: f64| EndErrors {
        run: run.to_owned(),
        manoeuvre: "circle".to_owned(),
        source: source.to_owned(),
        before: Pose::new(0.21, -0.056, yaw),
        after: Pose::new(0.004, 0.003, 0.1 * yaw),
    };
    let parameter = |name: &str, value: f64, identified: bool| CalibratedParameter {
        name: name.to_owned(),
        unit: "m".to_owned(),
        nominal: 0.31,
        value,
        interval: [value - 0.001, value + 0.001],
        identified,
        closed_form: if identified { value + 1e-4 } else { f64::NAN },
        decimals: 5,
    };
    let note = |name: &str, text: &str| RunNote { name: name.to_owned(), text: text.to_owned() };
    CalibrateReport {
        vehicle: "car <1:6> & more".to_owned(),
        method: "joint least squares over all runs".to_owned(),
        problem: None,
        runs: [3, 4],
        parameters: vec![parameter("track_front", 0.285, true), parameter("wheelbase", 0.3, false)],
        derived: vec![DerivedFigure {
            name: "epsilon rear".to_owned(),
            value: -9e-5,
            deviation: 1e-5,
            unit: "m".to_owned(),
        }],
        basis: "runs taking turns".to_owned(),
        left_out: vec![ends("left-0", "rear", -0.2), ends("left-0", "front", f64::NAN)],
        outliers: vec![ends("left-2", "rear", 0.5)],
        rms: vec![ends("rms of 2", "rear", 0.2)],
        judged: Some(ends("rms of 2", "rear", 0.2)),
        paths: vec![RunPaths {
            run: "left-0".to_owned(),
            manoeuvre: "circle".to_owned(),
            reference: arc(0.6),
            end: Some(Pose::new(0.3, 1.0, 2.0)),
            reckoned: vec![
                ReckonedPath { source: "rear".to_owned(), before: arc(0.55), after: arc(0.6) },
                ReckonedPath { source: "front".to_owned(), before: arc(0.5), after: arc(0.601) },
            ],
        }],
        residuals: vec![RunResidual {
            run: "left-0".to_owned(),
            travel: 9.4,
            reference: (1.02, 120),
            axles: (f64::NAN, 0),
        }],
        missing: vec![note("wheelbase", "full circles of 1.5 m radius to both sides")],
        rejected: vec![note("left-2", "what is known of its pose at 3.0 m is off")],
        findings: vec![note("all runs", "no turning")],
        notes: vec!["imu.csv: column ax not used".to_owned()],
        provenance: provenance("kerbside calibrate cases/car"),
    }
}

/// A calibration that identifies nothing.
pub(crate) fn uncalibrated() -> CalibrateReport {
    CalibrateReport {
        problem: Some("these runs identify nothing".to_owned()),
        judged: Some(EndErrors { before: Pose::new(f64::NAN, 0.0, 0.0), ..EndErrors::default() }),
        paths: vec![RunPaths { end: Some(Pose::new(f64::NAN, 0.0, 0.0)), ..RunPaths::default() }],
        ..CalibrateReport::default()
    }
}
