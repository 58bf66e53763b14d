//! The trial without its processes: drawing, judging, resuming and broken diagnoses. With a process that stands in for
//! the diagnosis where one is needed.

use std::os::unix::fs::PermissionsExt;

use super::*;

fn args(out: &Path, cases: u32) -> TrialArgs {
    TrialArgs {
        cases,
        nulls: 1,
        unlisted: 0,
        seed: 5,
        plant: Plant::Simulator,
        duration: 5.0,
        minutes: None,
        out: Some(out.to_owned()),
        json: true,
    }
}

/// A program that answers `none` to everything and counts how often it was asked; it is given `data` and `--out`.
fn always_none(folder: &Path, more: &str) -> PathBuf {
    let path = folder.join("always-none");
    let text = format!(
        "#!/bin/sh\n{more}\nname=$(basename \"$2\")\necho x >> {}/asked\n\
         printf '{{\"case\":\"%s\",\"verdict\":\"none\",\"where\":null,\"effects\":[],\"alternatives\":[],\"seconds\":0.1}}' \
         \"$name\" > \"$4/diagnosis.json\"\n",
        folder.display()
    );
    fs::write(&path, text).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

fn asked(folder: &Path) -> usize {
    fs::read_to_string(folder.join("asked")).map_or(0, |text| text.lines().count())
}

#[test]
fn the_same_seed_draws_the_same_cases_and_another_others() {
    let folder = tempfile::tempdir().unwrap();
    let args = args(folder.path(), 6);
    let labels = |args: &TrialArgs| -> Vec<String> {
        draw(args).iter().map(|one| label::text(&one.case, &[], &[])).collect()
    };
    assert_eq!(labels(&args), labels(&args));
    assert_ne!(labels(&args), labels(&TrialArgs { seed: 6, ..args.clone() }));
    let nulls = draw(&args).iter().filter(|one| one.case.specification.kind == Kind::Null).count();
    assert!(nulls >= 1, "one was asked for");
}

#[test]
fn causes_that_are_not_listed_come_in_turn_where_the_plant_knows_them() {
    let folder = tempfile::tempdir().unwrap();
    let unlisted =
        TrialArgs { unlisted: 3, nulls: 0, plant: Plant::ProvingGround, ..args(folder.path(), 1) };
    let drawn = draw(&unlisted);
    let cause = |known: &kerbside_proving_ground::insertions::Definition| {
        let of = |one: &&Drawn| one.case.specification.effects.iter().any(|e| e.id == known.id);
        drawn.iter().filter(of).count()
    };
    assert!(UNLISTED[..3].iter().all(|known| cause(known) >= 1));
    let plant = Plant::Simulator;
    assert!(draw(&TrialArgs { plant, ..unlisted }).len() <= 1, "that plant cannot drive them");
}

#[test]
fn a_trial_goes_on_where_it_ended_and_asks_nobody_twice() {
    let folder = tempfile::tempdir().unwrap();
    let (out, program) = (folder.path().join("out"), always_none(folder.path(), ""));
    let args = args(&out, 5);
    let exit = run_with(&TrialArgs { minutes: Some(0.0), ..args.clone() }, &program).unwrap();
    assert_eq!((exit, asked(folder.path())), (Exit::Bad, 0), "there was no time");
    assert_eq!(run_with(&args, &program).unwrap(), Exit::Bad, "nothing is found");
    let all = asked(folder.path());
    assert_eq!(all, draw(&args).len());
    assert_eq!(run_with(&args, &program).unwrap(), Exit::Bad);
    assert_eq!(asked(folder.path()), all);
    let other = TrialArgs { seed: 6, ..args };
    assert_eq!(run_with(&other, &program).unwrap_err().exit, Exit::Usage);
}

#[test]
fn a_label_that_is_changed_between_sittings_ends_the_trial() {
    let folder = tempfile::tempdir().unwrap();
    let (out, program) = (folder.path().join("out"), always_none(folder.path(), ""));
    let args = args(&out, 3);
    run_with(&args, &program).unwrap();
    let mut sealed = Sealed::kept(&out.join("sealed"), "case0001").unwrap();
    sealed.label.push_str("# better\n");
    sealed.keep(&out.join("sealed")).unwrap();
    let failure = run_with(&args, &program).unwrap_err();
    assert!(failure.report.to_string().contains("case0001"), "{:?}", failure.report);
}

#[test]
fn a_diagnosis_that_breaks_is_wrong_and_not_asked_again() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let program = always_none(folder.path(), "echo broken >&2; exit 70");
    let args = args(&out, 4);
    run_with(&args, &program).unwrap();
    let drawn = draw(&args);
    let sealed = seal_all(&args, &drawn, &out, &|| false).unwrap().unwrap();
    let score = open(&args, &drawn, &sealed, &out).unwrap();
    assert!(score.rows.iter().all(|row| row.verdict.is_none() && !row.exact));
    let alarms = score.false_alarms();
    assert!(alarms.of > 0 && alarms.right == alarms.of, "no answer is no right answer");
    for one in &drawn {
        let why = sitting::kept(&answers(&out, one)).unwrap().unwrap_err();
        assert!(why.contains("70") && why.contains("broken"), "{why}");
    }
}

#[test]
fn the_process_is_given_the_data_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (out, seen) = (folder.path().join("out"), folder.path().join("seen"));
    let look = format!("(cd \"$2\"; find . -type f; ls ..) >> {}", seen.display());
    run_with(&args(&out, 3), &always_none(folder.path(), &look)).unwrap();
    let text = fs::read_to_string(seen).unwrap();
    assert!(text.contains("./vehicle.toml") && text.contains("commands.csv"));
    assert!(
        !text.contains("label") && !text.contains("holdout") && !text.contains("seal"),
        "{text}"
    );
}
