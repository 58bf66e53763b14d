//! Made-up diagnoses of every verdict.

use kerbside_diagnosis::{
    Alternative, Diagnosis, FoundEffect, FoundParameter, Interval, Judged, LinkGap, MapPoint,
    Mistake, Next, RegimePlot, Rival, RunPaths, Shrinkage, Verdict,
};
use kerbside_geometry::{Pose, math};
use kerbside_reports::DiagnoseReport;
use kerbside_simulation::effects::Link;

use super::{Noise, WHEELBASE, provenance};

fn between(value: f64, half: f64) -> Interval {
    Interval { value, low: value - half, high: value + half }
}

fn effect(
    id: &'static str,
    link: Link,
    name: &'static str,
    unit: &'static str,
    value: Interval,
) -> FoundEffect {
    let parameters = vec![FoundParameter { name, unit, value }];
    FoundEffect { id, link, wheel: None, parameters, probability: 0.97 }
}

fn rival(name: &str, probability: f64, gain: f64, seed: u64) -> Rival {
    let mut noise = Noise(seed);
    let left_out =
        (0..6).map(|_| gain / 6.0 * (1.0 + 0.6 * noise.next()) + 3.0 * noise.next()).collect();
    Rival { name: name.to_owned(), probability, gain, left_out }
}

fn link(
    link: Link,
    signal: &'static str,
    unit: &'static str,
    [gap, floor, allowance]: [f64; 3],
) -> LinkGap {
    let excess = (gap * gap - floor * floor - allowance * allowance).max(0.0).sqrt();
    let half = 0.12 * gap;
    let (low, high) =
        ((excess - half).max(0.0), if excess > 0.0 { excess + half } else { 0.3 * floor });
    LinkGap { link, signal, unit, gap, floor, allowance, excess, low, high, measured: true }
}

fn unmeasured(link: Link) -> LinkGap {
    let none = f64::NAN;
    LinkGap {
        link,
        signal: "",
        unit: "",
        gap: none,
        floor: none,
        allowance: none,
        excess: none,
        low: none,
        high: none,
        measured: false,
    }
}

/// A path from a start by a steering law, every 20 ms: time and pose.
fn drive(start: Pose, gain: f64, offset: f64, law: fn(f64) -> (f64, f64)) -> Vec<(f64, Pose)> {
    let mut pose = start;
    (0..900_u32)
        .map(|step| {
            let t = 0.02 * f64::from(step);
            let (speed, steering) = law(t);
            let rolled = 0.02 * gain * speed;
            pose = pose.advance(rolled, rolled * math::tan(steering + offset) / WHEELBASE);
            (t, pose)
        })
        .collect()
}

fn run(name: &str, start: Pose, law: fn(f64) -> (f64, f64)) -> RunPaths {
    let mut noise = Noise(name.len() as u64);
    let paths = [(0.95, 0.022), (1.0, 0.0), (0.951, 0.0216)];
    let [measured, nominal, after] = paths.map(|(gain, offset)| drive(start, gain, offset, law));
    let plane = |path: &[(f64, Pose)]| path.iter().map(|(_, pose)| (pose.x, pose.y)).collect();
    let apart = |a: &Pose, b: &Pose| math::hypot(a.x - b.x, a.y - b.y);
    let errors = measured.iter().zip(&nominal).zip(&after);
    let errors = errors.map(|((measured, nominal), after)| {
        let seen = 0.002 * noise.next().abs();
        (measured.0, apart(&measured.1, &nominal.1) + seen, apart(&measured.1, &after.1) + seen)
    });
    let errors: Vec<_> = errors.step_by(5).collect();
    let map = measured.iter().step_by(6).map(|(t, pose)| {
        let (speed, steering) = law(*t);
        let excess = 9.0 * speed * (0.4 + 2.0 * steering.abs()) + 0.4 * noise.next();
        MapPoint { x: pose.x, y: pose.y, excess, direction: pose.yaw + 1.4 }
    });
    RunPaths {
        name: name.to_owned(),
        measured: plane(&measured),
        nominal: plane(&nominal),
        after: plane(&after),
        map: map.collect(),
        errors,
    }
}

fn slalom(t: f64) -> (f64, f64) {
    (if t < 17.0 { 0.35 } else { 0.0 }, 0.3 * math::sin(1.1 * t))
}

fn eight(t: f64) -> (f64, f64) {
    (0.3, if t < 9.0 { 0.32 } else { -0.32 })
}

fn shuttle(t: f64) -> (f64, f64) {
    (if t < 8.0 { 0.4 } else { -0.25 }, 0.06)
}

fn runs() -> Vec<RunPaths> {
    vec![
        run("shuttle-1", Pose::new(0.0, -0.8, 0.4), shuttle),
        run("slalom-1", Pose::new(-0.5, 0.6, 0.1), slalom),
        run("eight-1", Pose::new(1.0, 0.2, 1.2), eight),
    ]
}

/// The residual against the speed: what remains afterwards has no shape.
fn plot() -> RegimePlot {
    let mut noise = Noise(3);
    let points = (0..600_u32).map(|step| {
        let speed = f64::from(step % 200) * 0.0025;
        let seen = 0.004 * noise.next();
        (speed, 0.05 * speed + seen, seen + 0.001 * noise.next())
    });
    RegimePlot {
        axis: "speed [m/s]".to_owned(),
        signal: "speed residual [m/s]".to_owned(),
        points: points.collect(),
    }
}

fn horizons(nominal: f64, after: f64) -> Vec<(f64, f64, f64, f64)> {
    let times = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
    times.map(|t| (t, 0.002 + nominal * t * t.sqrt(), 0.002 + after * t, 0.002 + 0.0008 * t)).into()
}

fn diagnosis() -> Diagnosis {
    Diagnosis {
        case: "car <b>&\"7\"</b>".to_owned(),
        verdict: Verdict::Effects,
        sentence: "The gap is due to steering offset and speed gain: the wheels stand 0.022 rad to the left of what \
                   the sensor reads, and the car drives 5 % slower than told."
            .to_owned(),
        links_named: vec![Link::SpeedActuation, Link::Ground],
        moved: vec![Link::SpeedActuation, Link::Ground],
        effects: vec![
            effect("steering_offset", Link::Ground, "offset", "rad", between(0.022, 0.0015)),
            effect("speed_gain", Link::SpeedActuation, "gain", "", between(0.951, 0.004)),
        ],
        alternatives: vec![Alternative { ids: vec!["steering_offset", "speed_gain"], probability: 0.96 }],
        unseen: 0.04,
        ranking: vec![
            rival("steering_offset + speed_gain", 0.96, 5_200.0, 1),
            rival("steering_offset + acceleration_slip", 0.025, 4_600.0, 2),
            rival("unknown", 0.01, 0.0, 3),
            rival("steering_offset", 0.004, 3_100.0, 4),
            rival("speed_gain", 0.001, 2_300.0, 5),
            rival("lateral_drift", 0.0, 160.0, 6),
            rival("none", 0.0, 0.0, 7),
        ],
        mistake: None,
        links: vec![
            link(Link::SpeedActuation, "speed of the driven wheels", "m/s", [0.0183, 0.0021, 0.0011]),
            link(Link::SteeringActuation, "steering angle", "rad", [0.0021, 0.0020, 0.0012]),
            unmeasured(Link::Sensing),
            link(Link::Ground, "yaw", "rad", [0.0310, 0.0042, 0.0020]),
            link(Link::Reference, "course against heading", "rad", [0.0029, 0.0028, 0.0010]),
        ],
        gap: Some(Shrinkage {
            before: 0.198,
            after: 0.0134,
            floor: 0.0061,
            removed: Some(between(0.96, 0.03)),
            judged: Judged::LeftOut,
            yaw: [0.109, 0.0037, 0.0030],
            steps: vec![0.071, 0.0134],
        }),
        regime: "above 0.2 m/s, and in left turns more than in right ones".to_owned(),
        not_excited: vec!["steering_backlash", "floor_patch"],
        smallest_seen: vec![
            ("gyro_bias", 0.0021),
            ("understeer", 0.11),
            ("speed_lag", 0.012),
            ("wheelbase_scale", 0.0061),
            ("lateral_drift", 0.0031),
        ],
        next: None,
        paths: runs(),
        plot: Some(plot()),
        horizons: horizons(0.011, 0.0012),
        notices: vec!["Repeats were not driven: the noise floor is from standstill and split windows.".to_owned()],
        duration: 108.0,
    }
}

fn report(diagnosis: Diagnosis) -> DiagnoseReport {
    DiagnoseReport {
        diagnosis,
        vehicle: "car <1:6> & more".to_owned(),
        runs: ["shuttle-1", "slalom-1", "eight-1", "steps-1", "circle-1", "parking-1"]
            .map(str::to_owned)
            .into(),
        overlay: "diagnosis.overlay.toml".to_owned(),
        next_file: String::new(),
        notes: vec!["imu.csv: column ax not used".to_owned()],
        provenance: provenance("kerbside diagnose cases/car"),
    }
}

/// Two effects, found.
pub(crate) fn diagnosed() -> DiagnoseReport {
    report(diagnosis())
}

/// Two effects that the runs cannot tell apart, and what would.
pub(crate) fn ambiguous() -> DiagnoseReport {
    let gradient = effect("understeer", Link::Ground, "gradient", "s2/m2", between(0.61, 0.09));
    let set = |id, probability| Alternative { ids: vec![id], probability };
    let commands =
        [(0.0, 0.0, 0.0), (1.0, 0.0, 0.3), (2.0, 0.25, 0.3), (9.0, 0.5, 0.3), (16.0, 0.0, 0.3)];
    let diagnosis = Diagnosis {
        verdict: Verdict::Ambiguous,
        sentence: "The car turns less the faster it goes; these runs cannot tell understeer from steering compliance."
            .to_owned(),
        links_named: vec![Link::Ground],
        moved: vec![Link::Ground],
        effects: vec![gradient],
        alternatives: vec![set("understeer", 0.55), set("steering_compliance", 0.41)],
        unseen: 0.0,
        ranking: vec![
            rival("understeer", 0.55, 900.0, 1),
            rival("steering_compliance", 0.41, 896.0, 2),
            rival("unknown", 0.03, 0.0, 3),
        ],
        gap: Some(Shrinkage {
            before: 0.11,
            after: 0.02,
            floor: 0.02,
            removed: Some(between(0.97, 0.06)),
            judged: Judged::LeftOut,
            yaw: [0.05, 0.004, 0.004],
            steps: vec![0.02],
        }),
        next: Some(Next {
            manoeuvre: "circle at two speeds and two angles".to_owned(),
            separates: vec![vec!["understeer"], vec!["steering_compliance"]],
            sigma: 7.4,
            commands: commands.into(),
        }),
        ..diagnosis()
    };
    let next_file = "next.csv".to_owned();
    DiagnoseReport { next_file, ..report(diagnosis) }
}

/// Nothing beyond noise and what a car in good order may have.
pub(crate) fn no_gap() -> DiagnoseReport {
    let links = [
        (Link::SpeedActuation, "m/s", [0.0022, 0.0021, 0.0011]),
        (Link::SteeringActuation, "rad", [0.0021, 0.0020, 0.0012]),
        (Link::Sensing, "rad/s", [0.0030, 0.0031, 0.0004]),
        (Link::Ground, "rad", [0.0045, 0.0042, 0.0020]),
        (Link::Reference, "m", [0.0, 0.0, 0.0]),
    ];
    let diagnosis = Diagnosis {
        verdict: Verdict::None,
        sentence: "The simulator is as good as these runs can tell.".to_owned(),
        links_named: Vec::new(),
        moved: Vec::new(),
        effects: Vec::new(),
        alternatives: Vec::new(),
        unseen: 0.0,
        ranking: vec![rival("none", 0.96, 0.0, 1), rival("gyro_gain", 0.03, 2.0, 2)],
        links: links.map(|(of, unit, sizes)| link(of, "", unit, sizes)).into(),
        gap: Some(Shrinkage {
            before: 0.0071,
            after: 0.0071,
            floor: 0.0061,
            removed: None,
            judged: Judged::LeftOut,
            yaw: [0.003; 3],
            steps: Vec::new(),
        }),
        regime: String::new(),
        plot: None,
        paths: Vec::new(),
        ..diagnosis()
    };
    DiagnoseReport { overlay: String::new(), ..report(diagnosis) }
}

/// A gap that nothing listed explains, and figures that are none.
pub(crate) fn unknown() -> DiagnoseReport {
    let mut paths = runs();
    paths[0].map[3].excess = f64::NAN;
    paths[0].map[7].x = f64::INFINITY;
    paths[1].errors.clear();
    paths[2].nominal[5].0 = f64::NAN;
    let diagnosis = Diagnosis {
        verdict: Verdict::Unknown,
        sentence: "The car turns in by itself on one stretch of floor, and nothing that is listed does so.".to_owned(),
        links_named: vec![Link::Ground],
        moved: vec![Link::Ground],
        effects: Vec::new(),
        alternatives: vec![Alternative { ids: vec!["lateral_drift"], probability: 0.05 }],
        unseen: 0.0,
        ranking: vec![Rival { left_out: Vec::new(), ..rival("unknown", f64::NAN, f64::NAN, 3) }],
        gap: None,
        horizons: vec![(0.0, f64::NAN, 0.0, 0.0)],
        paths,
        ..diagnosis()
    };
    report(diagnosis)
}

/// A mistake in a recorded signal.
pub(crate) fn mistaken() -> DiagnoseReport {
    let diagnosis = Diagnosis {
        verdict: Verdict::Mistake,
        sentence: "The gyro's yaw rate has the wrong sign.".to_owned(),
        links_named: vec![Link::Sensing],
        moved: vec![Link::Sensing],
        effects: Vec::new(),
        alternatives: Vec::new(),
        unseen: 0.0,
        ranking: Vec::new(),
        mistake: Some(Mistake {
            kind: "sign",
            detail: "yaw rate has the wrong sign: correlation with the wheels' is -0.99".to_owned(),
            link: Link::Sensing,
        }),
        links: Vec::new(),
        gap: None,
        paths: Vec::new(),
        plot: None,
        horizons: Vec::new(),
        smallest_seen: Vec::new(),
        not_excited: Vec::new(),
        notices: Vec::new(),
        ..diagnosis()
    };
    DiagnoseReport { notes: Vec::new(), ..report(diagnosis) }
}
