//! `trial`: cases whose causes are drawn in secret, diagnosed by a process that is given the data alone, and held against
//! what was put in.
//!
//! First every case is drawn and its label sealed: only a commitment is printed. Then each case is written to a folder of
//! its own and diagnosed there. When all are answered the labels are opened, checked against the commitment and scored.
//! With `--out` all of it can be done in several sittings.

mod again;
mod answer;
pub mod folder;
mod holdout;
mod judge;
mod label;
mod plant;
mod print;
mod rivals;
mod score;
mod seal;
mod sitting;
mod size;
#[cfg(test)]
mod tests;
mod twins;

use std::fs;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kerbside_proving_ground::cases::{Case, Drives, Kind, Request, SecondVehicle, series};
use kerbside_proving_ground::insertions::UNLISTED;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

pub use plant::Simulated;

use crate::exit::{Exit, Failure};
use crate::figures::Figure;
use crate::output;
use answer::Answer;
use judge::Row;
use label::Label;
use score::{Score, Share};
use seal::Sealed;

/// Vehicles that are tried until one shows a cause.
const VEHICLES: usize = 200;

/// Who drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Plant {
    /// The second vehicle, with tyres and an integrator of its own.
    ProvingGround,
    /// The nominal simulator: the model that diagnoses.
    Simulator,
}

impl Plant {
    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ProvingGround => "proving-ground",
            Self::Simulator => "simulator",
        }
    }

    fn driver(self) -> &'static (dyn Drives + Sync) {
        match self {
            Self::ProvingGround => &SecondVehicle,
            Self::Simulator => &Simulated,
        }
    }

    /// Whether it can be given causes that are not listed.
    fn knows_unlisted(self) -> bool {
        self == Self::ProvingGround
    }
}

/// What `trial` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct TrialArgs {
    /// Number of cases; of a hundred 40 have one listed effect, 18 two, 20 none and 22 one that is not listed.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..))]
    pub cases: u32,
    /// Cases in good order besides.
    #[arg(long, default_value_t = 0)]
    pub nulls: u32,
    /// Cases besides whose cause is not listed; every such cause in turn.
    #[arg(long, default_value_t = 0)]
    pub unlisted: u32,
    /// Seed of everything but the salts.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Who drives.
    #[arg(long, value_enum, default_value = "proving-ground")]
    pub plant: Plant,
    /// Length of each drive in seconds.
    #[arg(long, default_value_t = 18.0, value_parser = duration)]
    pub duration: f64,
    /// End this sitting after so long; the same command with the same --out goes on.
    #[arg(long, value_name = "MINUTES", requires = "out")]
    pub minutes: Option<f64>,
    /// Folder for seals, answers and opened labels; a new one in the state folder where not given.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

fn duration(text: &str) -> Result<f64, String> {
    let allowed = 4.0..=300.0;
    let found = text.parse().ok().filter(|value| allowed.contains(value));
    found.ok_or_else(|| format!("found {text:?}, allowed is 4 to 300 s"))
}

/// A case of the trial. Nothing of it says what was put in but its seed and the request, and those stay here.
struct Drawn {
    name: String,
    case: Case,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the folder belongs to another trial, a label was changed, or nothing can be written.
pub fn run(args: &TrialArgs) -> Result<Exit, Failure> {
    run_with(args, &sitting::program()?)
}

/// Runs the verb with `program` for the diagnoses.
///
/// # Errors
/// As [`run`].
pub fn run_with(args: &TrialArgs, program: &Path) -> Result<Exit, Failure> {
    let begin = Instant::now();
    let late = || args.minutes.is_some_and(|most| begin.elapsed().as_secs_f64() > 60.0 * most);
    let out = output::folder(args.out.as_deref(), "trial")?;
    let hash = hash_of(program)?;
    same_trial(&out, args, &hash)?;
    let drawn = draw(args);
    let Some(sealed) = seal_all(args, &drawn, &out, &late)? else {
        return unfinished(&out, "sealed");
    };
    let root = commit(&sealed, &out)?;
    say(args, &format!("{} labels sealed\ncommitment  {root}", sealed.len()));
    let bar = bar(drawn.len(), "{bar:30} {pos}/{len} diagnosed, {elapsed}");
    let done = sitting::each(&drawn, &late, &|one| {
        diagnose(args, one, &out, program)?;
        bar.inc(1);
        Ok(())
    })?;
    bar.finish_and_clear();
    if !done {
        return unfinished(&out, "diagnosed");
    }
    let score = open(args, &drawn, &sealed, &out)?;
    let resolved = drive_again(args, &drawn, &score, &out, program)?;
    let facts = print::Facts { args, root: &root, program: &hash, out: &out, resolved };
    kerbside_runtime::end_on_broken_pipe();
    print::tell(&score, &facts);
    let passed = score.figures().iter().all(Figure::passed);
    Ok(if passed { Exit::Good } else { Exit::Bad })
}

/// Told as it goes, on standard error where standard output is for one object.
fn say(args: &TrialArgs, text: &str) {
    if args.json {
        eprintln!("{text}");
    } else {
        println!("{text}");
    }
}

fn unfinished(out: &Path, what: &str) -> Result<Exit, Failure> {
    eprintln!("not all are {what} yet: the same command with --out {} goes on", out.display());
    Ok(Exit::Bad)
}

fn hash_of(program: &Path) -> Result<String, Failure> {
    let bytes = fs::read(program).map_err(Failure::internal)?;
    Ok(seal::hex(&Sha256::digest(bytes)))
}

/// Writes down which trial this is; one that is there has to be the same.
fn same_trial(out: &Path, args: &TrialArgs, hash: &str) -> Result<(), Failure> {
    let path = out.join("trial.json");
    let now = json!({
        "schema": "kerbside.trial.begun.v1", "version": env!("CARGO_PKG_VERSION"), "cases": args.cases, "nulls": args.nulls,
        "unlisted": args.unlisted,
        "seed": args.seed, "plant": args.plant.name(), "duration": args.duration, "program": hash,
    });
    let Ok(text) = fs::read_to_string(&path) else {
        return output::write(&path, &format!("{now}\n"));
    };
    let known: Value = serde_json::from_str(&text).unwrap_or_default();
    if known == now {
        return Ok(());
    }
    Err(Failure::with_help(
        Exit::Usage,
        format!("{} holds another trial: {known}", out.display()),
        "take another --out, or the same --cases, --nulls, --unlisted, --seed, --plant, --duration and executable",
    ))
}

/// The cases, in an order of chance.
fn draw(args: &TrialArgs) -> Vec<Drawn> {
    let change = |request: Request| Request { duration: args.duration, ..request };
    let mut wanted = series(args.seed, args.cases as usize, change);
    let mut chance = Pcg64::seed_from_u64(args.seed);
    for _ in 0..args.nulls {
        let at = chance.random_range(0..=wanted.len());
        wanted.insert(at, (chance.random_range(0..1 << 53), change(Request::new(Kind::Null))));
    }
    for number in 0..args.unlisted as usize {
        let cause = UNLISTED[number % UNLISTED.len()].id;
        let request = Request { ids: vec![cause], ..change(Request::new(Kind::Unknown)) };
        let mut seeds = (0..VEHICLES).map(|_| chance.random_range(0..1 << 53));
        if let Some(seed) = seeds.find(|seed| Case::of(*seed, &request).is_some()) {
            let at = chance.random_range(0..=wanted.len());
            wanted.insert(at, (seed, request));
        }
    }
    let known = |request: &Request| args.plant.knows_unlisted() || request.kind != Kind::Unknown;
    let cases = wanted.iter().filter(|(_, request)| known(request));
    let cases = cases.filter_map(|(seed, request)| Case::of(*seed, request));
    cases
        .enumerate()
        .map(|(index, case)| Drawn { name: format!("case{:04}", index + 1), case })
        .collect()
}

/// Every label under seal, from this sitting or an earlier one; none where time was up before.
fn seal_all(
    args: &TrialArgs,
    drawn: &[Drawn],
    out: &Path,
    late: &(dyn Fn() -> bool + Sync),
) -> Result<Option<Vec<Sealed>>, Failure> {
    let folder = out.join("sealed");
    output::make(&folder)?;
    let bar = bar(drawn.len(), "{bar:30} {pos}/{len} sealed, {elapsed}");
    let done = sitting::each(drawn, late, &|one| {
        if Sealed::kept(&folder, &one.name).is_none() {
            let (sizes, twins) = twins::measured(&one.case, args.plant.driver());
            Sealed::new(&one.name, args.seed, label::text(&one.case, &sizes, &twins))?
                .keep(&folder)?;
        }
        bar.inc(1);
        Ok(())
    })?;
    bar.finish_and_clear();
    if !done {
        return Ok(None);
    }
    let kept = |one: &Drawn| {
        Sealed::kept(&folder, &one.name)
            .ok_or_else(|| Failure::internal(format!("the seal of {} is gone", one.name)))
    };
    drawn.iter().map(kept).collect::<Result<Vec<_>, _>>().map(Some)
}

/// Publishes the commitment, before anything is diagnosed; the root.
fn commit(sealed: &[Sealed], out: &Path) -> Result<String, Failure> {
    let path = out.join("commitments.txt");
    if !path.is_file() {
        output::write(&path, &seal::commitments(sealed))?;
    }
    check(sealed, out)?;
    Ok(seal::root(sealed))
}

fn check(sealed: &[Sealed], out: &Path) -> Result<(), Failure> {
    let published = fs::read_to_string(out.join("commitments.txt")).map_err(Failure::internal)?;
    seal::check(sealed, &published)
}

fn answers(out: &Path, one: &Drawn) -> PathBuf {
    out.join("diagnoses").join(&one.name)
}

/// One case: its data in a folder of its own, a process that knows no other, and nothing left but the answer.
fn diagnose(args: &TrialArgs, one: &Drawn, out: &Path, program: &Path) -> Result<(), Failure> {
    let place = answers(out, one);
    if sitting::kept(&place).is_some() {
        return Ok(());
    }
    let apart = tempfile::tempdir().map_err(Failure::internal)?;
    let data = apart.path().join(&one.name);
    folder::write(&data, &one.case, args.plant.driver())?;
    sitting::diagnose(program, &data, &place).map(|_| ())
}

/// Opens the labels and scores the answers.
fn open(
    args: &TrialArgs,
    drawn: &[Drawn],
    sealed: &[Sealed],
    out: &Path,
) -> Result<Score, Failure> {
    check(sealed, out)?;
    let rows: Mutex<Vec<Row>> = Mutex::default();
    let both: Vec<(&Drawn, &Sealed)> = drawn.iter().zip(sealed).collect();
    let bar = bar(drawn.len(), "{bar:30} {pos}/{len} scored, {elapsed}");
    sitting::each(&both, &|| false, &|(one, sealed)| {
        let row = scored(args, one, sealed, out)?;
        rows.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(row);
        bar.inc(1);
        Ok(())
    })?;
    bar.finish_and_clear();
    let mut rows = rows.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    rows.sort_by(|a, b| a.case.cmp(&b.case));
    Ok(Score { rows })
}

fn scored(args: &TrialArgs, one: &Drawn, sealed: &Sealed, out: &Path) -> Result<Row, Failure> {
    let opened = out.join("opened").join(&one.name);
    output::make(&opened)?;
    output::write(&opened.join("label.toml"), &sealed.label)?;
    let vehicle = kerbside_proving_ground::cases::vehicle_text(&one.case.specification);
    output::write(&opened.join("vehicle.toml"), &vehicle)?;
    let label = Label::parse(&sealed.label).map_err(Failure::internal)?;
    let document = sitting::kept(&answers(out, one)).and_then(Result::ok);
    let answer = document.as_ref().and_then(|document| Answer::read(document, &one.name).ok());
    let mut row = judge::judge(&one.name, &label, answer.as_ref());
    row.seconds = document.as_ref().and_then(|document| document["seconds"].as_f64());
    let driver = args.plant.driver();
    if let Some(answer) = answer.as_ref().filter(|_| !label.effects.is_empty()) {
        row.removed = holdout::removed(&one.case, driver, &holdout::overlay(answer));
    }
    if label.kind == Kind::Single.name() {
        row.rivals = rivals::right(&one.case, driver);
    }
    Ok(row)
}

/// Drives what ambiguous answers to large effects suggest, and counts those that are right then.
fn drive_again(
    args: &TrialArgs,
    drawn: &[Drawn],
    score: &Score,
    out: &Path,
    program: &Path,
) -> Result<Share, Failure> {
    let unsure = |row: &&Row| row.verdict.as_deref() == Some("ambiguous") && row.set;
    let jobs: Vec<(&Row, &Drawn)> = score
        .rows
        .iter()
        .filter(unsure)
        .filter_map(|row| Some((row, drawn.iter().find(|one| one.name == row.case)?)))
        .collect();
    let share: Mutex<Share> = Mutex::default();
    sitting::each(&jobs, &|| false, &|(row, one)| {
        let place = out.join("again").join(&one.name);
        if sitting::kept(&place).is_none() {
            let apart = tempfile::tempdir().map_err(Failure::internal)?;
            let data = apart.path().join(&one.name);
            if !again::write(&data, &one.case, args.plant.driver(), &answers(out, one))? {
                return Ok(());
            }
            sitting::diagnose(program, &data, &place)?.ok();
        }
        let document = sitting::kept(&place).and_then(Result::ok).unwrap_or_default();
        let answer = Answer::read(&document, &one.name).ok();
        let right = judge::judge(&one.name, &row.label, answer.as_ref()).right;
        let mut share = share.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        *share = Share { right: share.right + usize::from(right), of: share.of + 1 };
        Ok(())
    })?;
    Ok(share.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner))
}

/// A bar on a terminal, nothing in a pipe.
fn bar(length: usize, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(length as u64);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
        return bar;
    }
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
