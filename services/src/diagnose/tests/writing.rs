//! From a diagnosis to files that others read.

use kerbside_geometry::Wheel;
use kerbside_settings::parse_overlay;
use serde_json::Value;

use super::super::document::{NEXT, OVERLAY, REPORT};
use super::*;

/// What a reader of diagnosis.json holds it to.
fn problems(document: &Value, case: &str) -> Vec<String> {
    const LINKS: [&str; 5] =
        ["speed_actuation", "steering_actuation", "sensing", "ground", "reference"];
    let mut wrong = Vec::new();
    let mut hold = |good: bool, what: &str| wrong.extend((!good).then(|| what.to_owned()));
    hold(document["case"] == case, "case");
    let place = match &document["where"] {
        Value::Null => Vec::new(),
        Value::Array(list) => list.clone(),
        one => vec![one.clone()],
    };
    hold(place.iter().all(|link| LINKS.iter().any(|known| link == known)), "where");
    let names: Vec<&Value> =
        document["links"].as_array().unwrap().iter().map(|link| &link["name"]).collect();
    hold(names == LINKS, "links");
    for effect in document["effects"].as_array().unwrap() {
        let probability = effect["probability"].as_f64();
        hold(probability.is_some_and(|p| (0.0..=1.0).contains(&p)), "probability");
        for (name, parameter) in effect["parameters"].as_object().unwrap() {
            if name == "wheel" {
                hold(["fl", "fr", "rl", "rr"].iter().any(|w| parameter["value"] == *w), "wheel");
                continue;
            }
            let [low, value, high] = ["low", "value", "high"].map(|key| parameter[key].as_f64());
            hold(low.is_some() && low <= value && value <= high, "interval");
        }
    }
    let sets = document["alternatives"].as_array().unwrap();
    let sum: f64 = sets.iter().map(|set| set["probability"].as_f64().unwrap()).sum();
    hold(sum <= 1.001 && sets.iter().all(|set| !set["ids"][0].is_null()), "alternatives");
    let (effects, sets) = (!document["effects"][0].is_null(), sets.len());
    match document["verdict"].as_str().unwrap() {
        "effects" => hold(effects, "effects without effects"),
        "ambiguous" => hold(sets > 1, "ambiguous without alternatives"),
        "none" | "unknown" => hold(!effects, "effects"),
        "mistake" => hold(document["mistake"]["kind"].is_string(), "mistake without a kind"),
        other => hold(false, other),
    }
    wrong
}

#[test]
fn every_verdict_is_a_document_that_can_be_read() {
    for found in made_up::of_every_verdict() {
        assert_eq!(document::check(&found), Ok(()));
        let text = made_up::diagnosed(found).document().to_string();
        let document: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(problems(&document, "car07"), Vec::<String>::new(), "{document}");
        for key in ["schema", "version", "seed", "passed", "figures", "report", "notices"] {
            assert!(document.get(key).is_some(), "{key} is missing: {document}");
        }
    }
}

#[test]
fn an_open_interval_ends_at_the_largest_number() {
    let document = made_up::diagnosed(made_up::ambiguous()).document();
    assert_eq!(document["effects"][0]["parameters"]["limit"]["high"], f64::MAX);
    assert_eq!(document["links"][4]["gap"], Value::Null);
    let rounded: Value = serde_json::from_str(&document.to_string()).unwrap();
    assert!(rounded["effects"][0]["parameters"]["limit"]["high"].as_f64().unwrap().is_finite());
}

#[test]
fn a_diagnosis_that_contradicts_itself_is_a_defect() {
    let mut wrong: Vec<(Diagnosis, &str)> = Vec::new();
    let mut found = made_up::two_effects();
    found.effects[0].parameters[0].value.low = f64::NAN;
    wrong.push((found, "count_loss.fraction lies outside"));
    let mut found = made_up::two_effects();
    found.effects[1].probability = 1.2;
    wrong.push((found, "speed_gain has no probability"));
    let mut found = made_up::ambiguous();
    found.alternatives[0].probability = 0.9;
    wrong.push((found, "exceed 1"));
    let mut found = made_up::ambiguous();
    found.alternatives.truncate(1);
    wrong.push((found, "ambiguous contradicts"));
    let mut found = made_up::two_effects();
    found.verdict = kerbside_diagnosis::Verdict::Unknown;
    wrong.push((found, "unknown contradicts"));
    for (found, words) in wrong {
        let said = document::check(&found).unwrap_err();
        assert!(said.contains(words), "{words:?} in {said}");
    }
}

#[test]
fn the_overlay_says_where_it_comes_from_and_is_what_was_found() {
    let text = document::overlay(&made_up::two_effects());
    assert!(text.starts_with("# Found by kerbside"), "{text}");
    assert!(text.contains("fraction = 0.082   # 0.078000 to 0.086000"), "{text}");
    let read = parse_overlay(OVERLAY, &text).unwrap();
    let [loss, gain] = read.effects() else { panic!("two effects") };
    assert_eq!((loss.definition().id, loss.wheel()), ("count_loss", Some(Wheel::RearLeft)));
    assert_eq!(loss.value("fraction"), Some(0.082));
    assert_eq!((gain.definition().id, gain.value("gain")), ("speed_gain", Some(0.951)));
    // Whatever a folder is called, it stays in the comment.
    let mut odd = made_up::two_effects();
    odd.case = "car\nid = \"x\"".to_owned();
    assert_eq!(parse_overlay(OVERLAY, &document::overlay(&odd)).unwrap(), read);
}

/// Which of the files are there.
fn there(folder: &Path) -> [bool; 4] {
    [DIAGNOSIS, OVERLAY, NEXT, REPORT].map(|name| folder.join(name).is_file())
}

#[test]
fn a_case_is_diagnosed_into_its_folder_and_nothing_of_an_earlier_one_stays() {
    let cases = Cases::new();
    let mut args = DiagnoseArgs { case: Some(cases.add("ambiguous")), ..arguments(&cases) };
    let out = cases.path("out");
    assert_eq!(run_with(&args, &by_name).unwrap(), Exit::Good);
    assert_eq!(there(&out), [true; 4]);
    let commands = fs::read_to_string(out.join(NEXT)).unwrap();
    assert_eq!(commands, "t,speed,steering\n0,0,0\n1,0.25,0.1\n4.5,0,0.1\n");
    let document = read_json(&out.join(DIAGNOSIS));
    assert_eq!((&document["case"], &document["next"]["file"]), (&"ambiguous".into(), &NEXT.into()));
    let report = fs::read_to_string(out.join(REPORT)).unwrap();
    assert!(report.contains("kerbside diagnose") && report.contains("Not decided."));
    args.case = Some(cases.add("none"));
    run_with(&args, &by_name).unwrap();
    assert_eq!(there(&out), [true, false, false, true]);
    assert_eq!(read_json(&out.join(DIAGNOSIS))["verdict"], "none");
}

#[test]
fn a_defect_is_told_and_not_written_down() {
    let cases = Cases::new();
    let args = DiagnoseArgs { case: Some(cases.add("defect")), ..arguments(&cases) };
    let failure = run_with(&args, &by_name).unwrap_err();
    assert_eq!(failure.exit, Exit::Internal);
    assert_eq!(there(&cases.path("out")), [false; 4]);
}
