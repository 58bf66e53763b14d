//! Made-up diagnoses, for tests of what is told and written.

use kerbside_diagnosis::{
    Alternative, Case, Diagnosis, FoundEffect, FoundParameter, Interval, Judged, LinkGap, Mistake,
    Next, Rival, Shrinkage, Verdict,
};
use kerbside_geometry::Vehicle;
use kerbside_simulation::effects::Link;

use super::{Diagnosed, Input};

const fn between(value: f64, half: f64) -> Interval {
    Interval { value, low: value - half, high: value + half }
}

fn effect(
    id: &'static str,
    link: Link,
    parameters: &[(&'static str, &'static str, Interval)],
) -> FoundEffect {
    let parameter = |&(name, unit, value): &_| FoundParameter { name, unit, value };
    let parameters = parameters.iter().map(parameter).collect();
    FoundEffect { id, link, wheel: None, parameters, probability: 0.98 }
}

fn rival(name: &str, probability: f64) -> Rival {
    let left_out = vec![12.0, 9.5, -0.3];
    Rival { name: name.to_owned(), probability, gain: 24.0, left_out }
}

fn links() -> Vec<LinkGap> {
    let link = |(link, signal, unit, [gap, floor, allowance]): (_, _, _, [f64; 3])| {
        let excess = (gap - floor - allowance).max(0.0);
        let (low, high, measured) = (0.8 * excess, 1.2 * excess + 0.0004, f64::is_finite(gap));
        LinkGap { link, signal, unit, gap, floor, allowance, excess, low, high, measured }
    };
    [
        (Link::SpeedActuation, "speed of the driven wheels", "m/s", [0.0183, 0.0021, 0.0011]),
        (Link::SteeringActuation, "steering angle", "rad", [0.0021, 0.0020, 0.0012]),
        (Link::Sensing, "yaw rate", "rad/s", [0.0310, 0.0042, 0.0020]),
        (Link::Ground, "yaw", "rad", [0.0052, 0.0042, 0.0020]),
        (Link::Reference, "", "", [f64::NAN; 3]),
    ]
    .map(link)
    .into()
}

fn nothing() -> Diagnosis {
    Diagnosis {
        case: "car07".to_owned(),
        verdict: Verdict::None,
        sentence: "The simulator is as good as these runs can tell.".to_owned(),
        links_named: Vec::new(),
        moved: Vec::new(),
        effects: Vec::new(),
        alternatives: Vec::new(),
        unseen: 0.04,
        ranking: vec![rival("none", 0.97), rival("gyro_gain", 0.02)],
        mistake: None,
        links: links(),
        gap: None,
        regime: String::new(),
        not_excited: vec!["steering_backlash", "floor_patch", "steering_compliance", "understeer"],
        smallest_seen: vec![("gyro_bias", 0.002)],
        next: None,
        paths: Vec::new(),
        plot: None,
        horizons: Vec::new(),
        notices: vec![
            "There are no repeats: the noise floor is from standstill and split windows, and wider."
                .to_owned(),
        ],
        duration: 54.0,
    }
}

/// Two effects, one of which sits at a wheel.
pub fn two_effects() -> Diagnosis {
    let mut loss = effect("count_loss", Link::Sensing, &[("fraction", "", between(0.082, 0.004))]);
    loss.wheel = Some("rl");
    let gain = effect("speed_gain", Link::SpeedActuation, &[("gain", "", between(0.951, 0.004))]);
    Diagnosis {
        verdict: Verdict::Effects,
        sentence: "The gap is due to count loss and speed gain: the left rear wheel loses 8 % of its counts, and the \
                   car drives 5 % slower than told."
            .to_owned(),
        links_named: vec![Link::SpeedActuation, Link::Sensing],
        moved: vec![Link::SpeedActuation, Link::Sensing],
        effects: vec![loss, gain],
        alternatives: vec![Alternative { ids: vec!["count_loss", "speed_gain"], probability: 0.96 }],
        unseen: 0.0,
        ranking: vec![rival("count_loss + speed_gain", 0.96), rival("unknown", 0.01)],
        gap: Some(Shrinkage {
            before: 0.198,
            after: 0.0134,
            floor: 0.0061,
            removed: Some(between(0.96, 0.03)),
            judged: Judged::LeftOut,
            yaw: [0.109, 0.0037, 0.0030],
            steps: vec![0.071, 0.0134],
        }),
        regime: "above 0.2 m/s".to_owned(),
        ..nothing()
    }
}

/// Two effects that the runs cannot tell apart; a limit that may be as high as it likes.
pub fn ambiguous() -> Diagnosis {
    let open = Interval { value: 0.2, low: 0.15, high: f64::INFINITY };
    let set = |id, probability| Alternative { ids: vec![id], probability };
    Diagnosis {
        verdict: Verdict::Ambiguous,
        sentence: "These runs cannot tell a limit of the acceleration from a longer lag."
            .to_owned(),
        links_named: vec![Link::SpeedActuation],
        moved: vec![Link::SpeedActuation],
        effects: vec![effect(
            "acceleration_limit",
            Link::SpeedActuation,
            &[("limit", "m/s2", open)],
        )],
        alternatives: vec![set("acceleration_limit", 0.5), set("speed_lag", 0.44)],
        unseen: 0.0,
        ranking: vec![rival("acceleration_limit", 0.5), rival("speed_lag", 0.44)],
        next: Some(Next {
            manoeuvre: "circle with steps of the speed, small and large".to_owned(),
            separates: vec![vec!["acceleration_limit"], vec!["speed_lag"]],
            sigma: 7.4,
            commands: vec![(0.0, 0.0, 0.0), (1.0, 0.25, 0.1), (4.5, 0.0, 0.1)],
        }),
        ..nothing()
    }
}

/// One of each verdict.
pub fn of_every_verdict() -> Vec<Diagnosis> {
    let unknown = Diagnosis {
        verdict: Verdict::Unknown,
        sentence: "The car turns in by itself, and nothing that is listed does so.".to_owned(),
        links_named: vec![Link::Ground],
        moved: vec![Link::Ground],
        unseen: 0.0,
        ranking: vec![rival("unknown", 0.9)],
        ..nothing()
    };
    let mistake = Diagnosis {
        verdict: Verdict::Mistake,
        sentence: "The gyro's yaw rate has the wrong sign.".to_owned(),
        links_named: vec![Link::Sensing],
        moved: vec![Link::Sensing],
        mistake: Some(Mistake {
            kind: "sign",
            detail: "imu.csv: the yaw rate is the wheels' with the other sign".to_owned(),
            link: Link::Sensing,
        }),
        ..nothing()
    };
    vec![nothing(), two_effects(), ambiguous(), unknown, mistake]
}

/// As if the case had been read.
pub fn diagnosed(found: Diagnosis) -> Diagnosed {
    let (name, vehicle) = (found.case.clone(), Vehicle::paper_car());
    let case = Case { name, vehicle, allowance: None, runs: Vec::new() };
    let notices = vec!["imu.csv: column ax not used".to_owned()];
    let input = Input { origin: "car07/vehicle.toml".to_owned(), case, notices };
    Diagnosed { input, found, model: None, seconds: 1.5 }
}
