//! What holds for every report, whatever it is made from.

#![allow(clippy::unwrap_used)] // what helps a test is a test

mod samples;

use std::collections::BTreeSet;

use kerbside_simulation::effects::Link;

fn pages() -> Vec<(&'static str, String)> {
    vec![
        ("parked", samples::parked().render().unwrap()),
        ("broken off", samples::broken_off().render().unwrap()),
        ("empty", samples::empty().render().unwrap()),
        ("not numbers", samples::not_numbers().render().unwrap()),
        ("replayed", samples::replayed().render().unwrap()),
        ("refused", samples::refused().render().unwrap()),
        ("calibrated", samples::calibrated().render().unwrap()),
        ("not calibrated", samples::uncalibrated().render().unwrap()),
        ("diagnosed", samples::diagnosed().render().unwrap()),
        ("ambiguous", samples::ambiguous().render().unwrap()),
        ("no gap", samples::no_gap().render().unwrap()),
        ("unknown", samples::unknown().render().unwrap()),
        ("mistaken", samples::mistaken().render().unwrap()),
    ]
}

fn files() -> Vec<(&'static str, String)> {
    let mut files = pages();
    files.push(("picture of a park", samples::parked().picture()));
    files.push(("picture of nothing", samples::empty().picture()));
    files.push(("picture of a replay", samples::replayed().picture()));
    files
}

/// A tag of a file: its name, its attributes, and whether it opens, closes or stands alone.
#[derive(Debug, PartialEq)]
enum Tag {
    Open(String, Vec<(String, String)>),
    Close(String),
    Alone(String, Vec<(String, String)>),
}

/// Reads XML strictly: quoted attributes, each once; known entities only; nothing after the root.
fn tags(text: &str) -> Result<Vec<Tag>, String> {
    let body = text.strip_prefix("<!DOCTYPE html>").unwrap_or(text);
    let mut tags = Vec::new();
    let mut rest = body;
    while let Some(start) = rest.find('<') {
        check_text(&rest[..start])?;
        let end = rest[start..].find('>').ok_or("a tag without an end")? + start;
        tags.push(tag(&rest[start + 1..end])?);
        rest = &rest[end + 1..];
    }
    check_text(rest)?;
    Ok(tags)
}

fn check_text(text: &str) -> Result<(), String> {
    if let Some(control) = text.chars().find(|c| c.is_control() && !matches!(c, '\n' | '\t')) {
        return Err(format!("control character {control:?}"));
    }
    for entity in text.split('&').skip(1) {
        let name = entity.split_once(';').map(|(name, _)| name).unwrap_or_default();
        let is_number = name.strip_prefix('#').is_some_and(|n| n.parse::<u32>().is_ok());
        if !is_number && !["amp", "lt", "gt", "quot"].contains(&name) {
            return Err(format!("a bare ampersand before {entity:.20}"));
        }
    }
    Ok(())
}

fn tag(inside: &str) -> Result<Tag, String> {
    if let Some(name) = inside.strip_prefix('/') {
        return Ok(Tag::Close(name.to_owned()));
    }
    let (inside, alone) = match inside.strip_suffix('/') {
        Some(inside) => (inside, true),
        None => (inside, false),
    };
    let (name, mut rest) = inside.split_once(char::is_whitespace).unwrap_or((inside, ""));
    if !name.chars().all(|c| c.is_ascii_alphanumeric()) || name.is_empty() {
        return Err(format!("a tag named {name:?}"));
    }
    let mut attributes: Vec<(String, String)> = Vec::new();
    while !rest.trim().is_empty() {
        let (key, after) = rest.trim_start().split_once("=\"").ok_or(format!("in {inside}"))?;
        let (value, after) = after.split_once('"').ok_or(format!("open quote in {inside}"))?;
        check_text(value)?;
        if attributes.iter().any(|(other, _)| other == key) || key.contains(char::is_whitespace) {
            return Err(format!("attribute {key:?} in {inside}"));
        }
        attributes.push((key.to_owned(), value.to_owned()));
        rest = after;
    }
    let name = name.to_owned();
    Ok(if alone { Tag::Alone(name, attributes) } else { Tag::Open(name, attributes) })
}

fn check_balance(tags: &[Tag]) -> Result<(), String> {
    let mut open: Vec<&str> = Vec::new();
    for (index, tag) in tags.iter().enumerate() {
        match tag {
            Tag::Open(name, _) => open.push(name),
            Tag::Close(name) => match open.pop() {
                Some(last) if last == name => {}
                last => return Err(format!("</{name}> closes {last:?}")),
            },
            Tag::Alone(..) => {}
        }
        if open.is_empty() && index + 1 < tags.len() {
            return Err("something follows the root".to_owned());
        }
    }
    if open.is_empty() { Ok(()) } else { Err(format!("left open: {open:?}")) }
}

fn attributes(tags: &[Tag]) -> impl Iterator<Item = &(String, String)> {
    tags.iter().flat_map(|tag| match tag {
        Tag::Open(_, attributes) | Tag::Alone(_, attributes) => attributes.as_slice(),
        Tag::Close(_) => &[],
    })
}

#[test]
fn the_checker_finds_what_is_wrong() {
    for bad in [
        "<a><b></a></b>",
        "<a>",
        "<a></a><b></b>",
        "<a b=c></a>",
        "<a b=\"1\" b=\"2\"></a>",
        "<a>&</a>",
        "<a>&nbsp;</a>",
        "<a>\u{1}</a>",
        "<a><</a>",
    ] {
        let verdict = tags(bad).and_then(|tags| check_balance(&tags));
        assert!(verdict.is_err(), "{bad} passed");
    }
    let good = "<!DOCTYPE html>\n<a b=\"1\" c=\"&#34;\"><d e=\"f\" /><g/>&#60;</a>\n";
    assert_eq!(tags(good).and_then(|tags| check_balance(&tags)), Ok(()));
}

#[test]
fn every_file_is_well_formed() {
    for (name, text) in files() {
        let verdict = tags(&text).and_then(|tags| check_balance(&tags));
        assert_eq!(verdict, Ok(()), "{name}");
    }
}

#[test]
fn identifiers_are_unique_and_references_meet_them() {
    for (name, text) in files() {
        let tags = tags(&text).unwrap();
        let ids: Vec<_> = attributes(&tags).filter(|a| a.0 == "id").map(|a| a.1.as_str()).collect();
        let unique: BTreeSet<_> = ids.iter().copied().collect();
        assert_eq!(unique.len(), ids.len(), "{name}: {ids:?}");
        for (key, value) in attributes(&tags) {
            let targets: Vec<&str> = match key.as_str() {
                "aria-labelledby" => value.split(' ').collect(),
                "href" => vec![value.strip_prefix('#').unwrap_or("not a fragment")],
                _ => continue,
            };
            for target in targets {
                assert!(unique.contains(target), "{name}: {key} {value}");
            }
        }
    }
}

#[test]
fn nothing_comes_from_elsewhere() {
    for (name, text) in files() {
        let tags = tags(&text).unwrap();
        for (key, value) in attributes(&tags) {
            let is_remote = value.contains("//") || value.contains("data:");
            assert!(key == "xmlns" || !is_remote, "{name}: {key} {value}");
            assert!(!["src", "srcset", "onload", "onclick"].contains(&key.as_str()), "{name}");
        }
        let names = tags.iter().map(|tag| match tag {
            Tag::Open(name, _) | Tag::Alone(name, _) | Tag::Close(name) => name.as_str(),
        });
        let foreign = ["script", "link", "iframe", "object", "img", "image", "use", "base"];
        assert_eq!(names.filter(|name| foreign.contains(name)).count(), 0, "{name}");
        assert!(!text.contains("@import") && !text.contains("url("), "{name}");
    }
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    for (first, second) in files().into_iter().zip(files()) {
        assert!(first.1 == second.1, "{} differs", first.0);
    }
}

#[test]
fn what_is_not_a_number_is_never_drawn() {
    for (name, text) in files() {
        let tags = tags(&text).unwrap();
        for (key, value) in attributes(&tags) {
            let drawn = ["d", "x", "y", "width", "height", "x1", "y1", "x2", "y2", "cx", "viewBox"];
            if drawn.contains(&key.as_str()) {
                assert!(!value.contains("NaN") && !value.contains("inf"), "{name}: {key} {value}");
            }
        }
        assert!(!text.contains("NaN"), "{name}");
    }
}

#[test]
fn text_stays_text() {
    let page = samples::broken_off().render().unwrap();
    assert!(page.contains("&#60;script&#62;alert(1)"), "the cause is shown as it was given");
    assert!(page.contains("garage &#60;b&#62;&#38;&#34;&#39;&#60;/b&#62;"));
    assert!(page.contains("Not parked."));
    assert!(page.contains("The vehicle touched an obstacle."));
}

#[test]
fn every_drawing_has_words_for_those_who_cannot_see_it() {
    for (name, text) in files() {
        let tags = tags(&text).unwrap();
        let has =
            |attributes: &[(String, String)], key: &str| attributes.iter().any(|a| a.0 == key);
        for tag in &tags {
            let Tag::Open(element, attributes) = tag else { continue };
            if element == "svg" {
                let is_window = attributes.iter().any(|a| a.0 == "class" && a.1 == "window");
                let is_named = has(attributes, "aria-labelledby") && has(attributes, "role");
                assert!(is_window || is_named || has(attributes, "aria-hidden"), "{name}: {tag:?}");
            }
        }
    }
}

#[test]
fn a_parked_page_says_what_it_must() {
    let page = samples::parked().render().unwrap();
    for word in [
        "Parked.",
        "judged on the true pose",
        "48.7\u{202f}mm",
        "53.2\u{202f}mm",
        "p99.9",
        "2 sigma",
        "estimator",
        "kerbside park garage --seed 42",
        "garage.mcap",
        "driving \u{2192} done",
    ] {
        assert!(page.contains(word), "{word:?} is missing");
    }
}

#[test]
fn a_calibration_page_says_what_it_must() {
    let page = samples::calibrated().render().unwrap();
    for word in [
        "Calibrated.",
        "1 parameter is not identified",
        "217.3\u{202f}mm before",
        "0.28400 to 0.28600",
        "no, kept as it was",
        "left-0, before",
        "left-2 (rejected, does not count)",
        "full circles of 1.5 m radius to both sides",
        "epsilon rear",
        "kerbside calibrate cases/car",
    ] {
        assert!(page.contains(word), "{word:?} is missing");
    }
    let page = samples::uncalibrated().render().unwrap();
    assert!(page.contains("Not good.") && page.contains("These runs identify nothing."), "{page}");
}

#[test]
fn a_diagnosis_says_where_which_how_far_and_what_next() {
    let page = samples::diagnosed().render().unwrap();
    for word in [
        "Several effects.",
        "steering offset and speed gain",
        "Gap removed",
        "96.0\u{202f}%",
        "<text class=\"row-name\"",
        "not measured",
        "slalom-1, distance from the measured path",
        "0.0220 (0.0205 to 0.0235)",
        "acceleration slip",
        "The verdict&#39;s nearest rival is",
        "Nothing is left that another manoeuvre would separate.",
        "kerbside diagnose cases/car",
    ] {
        assert!(page.contains(word), "{word:?} is missing");
    }
    let page = samples::ambiguous().render().unwrap();
    for word in ["Not decided.", "understeer or steering compliance", "next.csv", "circle"] {
        assert!(page.to_lowercase().contains(&word.to_lowercase()), "{word:?} is missing");
    }
    let page = samples::no_gap().render().unwrap();
    assert!(page.contains("No gap.") && page.contains("Nowhere"));
    let page = samples::unknown().render().unwrap();
    assert!(page.contains("Unknown cause.") && page.contains("would be a guess"));
    let page = samples::mistaken().render().unwrap();
    assert!(page.contains("A mistake.") && page.contains("yaw rate has the wrong sign"));
}

/// What a second effect may hold unseen stands beside the probability, and nothing does where there is none.
#[test]
fn what_may_act_unseen_stands_beside_the_probability() {
    let page = samples::diagnosed().render().unwrap();
    assert!(page.contains("0.04 that another acts unseen"));
    assert!(page.contains("too small for these runs, acts beside it has a probability of 0.04"));
    for page in [samples::ambiguous(), samples::no_gap(), samples::unknown()] {
        let page = page.render().unwrap();
        assert!(page.contains("of this answer") && !page.contains("acts beside it"));
    }
}

/// Which links moved before any fit stands beside the chain, and whether the answer agrees.
#[test]
fn the_chain_says_which_links_moved_before_any_fit() {
    let mut report = samples::diagnosed();
    let both = "patterns of several links, the likeliest first: speed actuation, ground. The answer is in keeping";
    let page = report.render().unwrap();
    assert!(page.contains(both), "{page}");
    report.diagnosis.moved.truncate(1);
    let page = report.render().unwrap();
    for word in
        ["one link had moved", "pattern of speed actuation.", "was found elsewhere: ground."]
    {
        assert!(page.contains(word), "{word:?} is missing");
    }
    let mut report = samples::no_gap();
    let page = report.render().unwrap();
    assert!(page.contains("no link had moved") && !page.contains("The answer is"), "{page}");
    report.diagnosis.moved.push(Link::Reference);
    let page = report.render().unwrap();
    assert!(page.contains("pattern of reference. The answer is at no link all the same."));
}

/// The excess of a link is drawn beyond what is allowed, and only of a link that has one.
#[test]
fn the_chain_shows_excess_where_there_is_one() {
    let chain = |page: String| {
        let figure = page.split("<figure id=\"chain\">").nth(1).unwrap().to_owned();
        // The legend shows the mark once.
        figure.split("</figure>").next().unwrap().matches("bar vermilion").count() - 1
    };
    assert_eq!(chain(samples::diagnosed().render().unwrap()), 2);
    assert_eq!(chain(samples::no_gap().render().unwrap()), 0);
}

#[test]
fn a_diagnosis_of_many_long_runs_stays_small() {
    let mut report = samples::diagnosed();
    let run = report.diagnosis.paths[0].clone();
    for number in 0..60 {
        let mut run = run.clone();
        run.name = format!("run-{number}");
        for _ in 0..4 {
            run.map.extend(run.map.clone());
            run.measured.extend(run.measured.clone());
        }
        report.diagnosis.paths.push(run);
    }
    let points: usize = report.diagnosis.paths.iter().map(|run| run.map.len()).sum();
    assert!(points > 100_000, "{points}");
    let page = report.render().unwrap();
    assert!(page.len() < 1_500_000, "{} bytes", page.len());
}

#[test]
fn a_page_stays_small_for_a_long_drive() {
    let mut report = samples::parked();
    let long = report.truth.len();
    for times in 0..60 {
        for index in 0..long {
            let mut motion = report.truth[index];
            motion.time += 30.0 * f64::from(times + 1);
            report.truth.push(motion);
        }
    }
    assert!(report.truth.len() > 70_000);
    let page = report.render().unwrap();
    assert!(page.len() < 600_000, "{} bytes", page.len());
}
