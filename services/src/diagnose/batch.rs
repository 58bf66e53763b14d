//! Many cases: all cores, a line each, a table of all. A broken case is told and the others are finished; what was
//! diagnosed before, by the same version, is kept.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use indicatif::ProgressBar;
use serde_json::{Value, json};

use super::table::{self, Row};
use super::{DiagnoseArgs, Diagnoser, files};
use crate::configuration::Refused;
use crate::exit::{Exit, Failure};
use crate::output;

/// A part of a batch: the `index`-th of `of`, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: usize,
    of: usize,
}

/// I/N.
///
/// # Errors
/// What was found and what is allowed.
pub fn parse_shard(text: &str) -> Result<Shard, String> {
    let numbers = text
        .split_once('/')
        .and_then(|(index, of)| Some(Shard { index: index.parse().ok()?, of: of.parse().ok()? }));
    numbers
        .filter(|shard| (1..=shard.of).contains(&shard.index))
        .ok_or_else(|| format!("found {text:?}, allowed is I/N with I from 1 to N"))
}

impl core::fmt::Display for Shard {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

/// A case folder, and the folder that its diagnosis goes to.
#[derive(Clone, Debug)]
struct Job {
    name: String,
    case: PathBuf,
    out: PathBuf,
}

/// What came of a job.
struct Done {
    row: Row,
    /// It was diagnosed before.
    kept: bool,
}

/// Runs a batch over the case folders in `cases`.
///
/// # Errors
/// [`Failure`] where there is no case, or nothing can be written.
pub fn run(args: &DiagnoseArgs, cases: &Path, diagnoser: &Diagnoser<'_>) -> Result<Exit, Failure> {
    let out = output::folder(args.out.as_deref(), "diagnose")?;
    let jobs = jobs(cases, &out, args.shard)?;
    kerbside_runtime::end_on_broken_pipe();
    let bar = super::bar(jobs.len() as u64, "{bar:30} {pos}/{len} cases, {elapsed}");
    let done = all(args, &jobs, &bar, diagnoser);
    bar.finish_and_clear();
    let rows: Vec<&Row> = done.iter().map(|done| &done.row).collect();
    let path = out.join(table_name(args.shard));
    table::write(&path, &rows)?;
    let kept = done.iter().filter(|done| done.kept).count();
    tell(args, &rows, kept, &path);
    let passed = rows.iter().all(|row| row.result.is_ok());
    Ok(if passed { Exit::Good } else { Exit::Bad })
}

/// The cases in the order of their names, or the shard's share of them.
fn jobs(cases: &Path, out: &Path, shard: Option<Shard>) -> Result<Vec<Job>, Failure> {
    let io =
        |error: std::io::Error| Failure::new(Exit::Data, format!("{}: {error}", cases.display()));
    let mut found = Vec::new();
    for entry in std::fs::read_dir(cases).map_err(io)? {
        let case = entry.map_err(io)?.path();
        // A folder with either is a case, if a broken one.
        let is_case = case.join("vehicle.toml").is_file() || case.join("runs").is_dir();
        if let Some(name) = case.file_name().filter(|_| is_case) {
            let name = name.to_string_lossy().into_owned();
            found.push(Job { out: out.join(&name), name, case });
        }
    }
    if found.is_empty() {
        return Err(Failure::with_help(
            Exit::Data,
            format!("{}: there is no case in it", cases.display()),
            "a case is a folder with vehicle.toml and a folder runs/NAME per run",
        ));
    }
    found.sort_by(|a, b| a.name.cmp(&b.name));
    let Shard { index, of } = shard.unwrap_or(Shard { index: 1, of: 1 });
    Ok(found.into_iter().skip(index - 1).step_by(of).collect())
}

fn table_name(shard: Option<Shard>) -> String {
    match shard {
        Some(Shard { index, of }) => format!("diagnoses-{index}-of-{of}.parquet"),
        None => "diagnoses.parquet".to_owned(),
    }
}

/// All jobs on all cores, in the order of the jobs.
fn all(
    args: &DiagnoseArgs,
    jobs: &[Job],
    bar: &ProgressBar,
    diagnoser: &Diagnoser<'_>,
) -> Vec<Done> {
    let cores = thread::available_parallelism().map_or(1, |cores| cores.get());
    let next = AtomicUsize::new(0);
    let done: Mutex<BTreeMap<usize, Done>> = Mutex::default();
    let work = || {
        while let Some((index, job)) = take(&next, jobs) {
            let result = one(args, job, diagnoser);
            bar.suspend(|| say(args, &result));
            bar.inc(1);
            done.lock().unwrap_or_else(std::sync::PoisonError::into_inner).insert(index, result);
        }
    };
    thread::scope(|scope| {
        for _ in 1..cores.min(jobs.len()) {
            scope.spawn(work);
        }
        work();
    });
    let done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    done.into_values().collect()
}

fn take<'a>(next: &AtomicUsize, jobs: &'a [Job]) -> Option<(usize, &'a Job)> {
    let index = next.fetch_add(1, Ordering::Relaxed);
    Some((index, jobs.get(index)?))
}

/// One case, whatever befalls it.
fn one(args: &DiagnoseArgs, job: &Job, diagnoser: &Diagnoser<'_>) -> Done {
    let model = args.model();
    let found = |result, kept| Done { row: Row { case: job.name.clone(), result }, kept };
    if let Some(document) = files::kept(&job.out, model.as_deref()).filter(|_| !args.fresh) {
        return found(Ok(document), true);
    }
    // A defect that shows in one case must not cost the others.
    let result = catch_unwind(AssertUnwindSafe(|| {
        let diagnosed = super::diagnosed(&job.case, model.clone(), diagnoser, &|_, _| {})?;
        files::write(&job.out, &diagnosed, &args.command_line(&job.case))?;
        // The table is of what is on the disk, now and when it is kept.
        files::kept(&job.out, model.as_deref())
            .ok_or_else(|| Failure::internal("it cannot be read again"))
    }));
    let defect = |_| Err(Failure::internal("a defect of kerbside; it is told above"));
    let result = result.unwrap_or_else(defect).map_err(|failure| words(&failure));
    if result.is_err() {
        // What another version found is not what this one did.
        let _ = files::clear(&job.out);
    }
    found(result, false)
}

/// A failure in one line.
fn words(failure: &Failure) -> String {
    let refused = failure.report.downcast_ref::<Refused>();
    let problems: Vec<String> = refused.iter().flat_map(|refused| refused.lines()).collect();
    let text = match &problems[..] {
        [] => failure.report.to_string(),
        problems => problems.join("; "),
    };
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A line on standard output, or on standard error where that is for one object.
fn say(args: &DiagnoseArgs, done: &Done) {
    let Row { case, result } = &done.row;
    let line = match result {
        Ok(document) => {
            let text = |key: &str| document[key].as_str().unwrap_or_default();
            let seconds = document["seconds"].as_f64().unwrap_or_default();
            let time = if done.kept { "kept".to_owned() } else { format!("{seconds:.1} s") };
            let effects = table::effects(document);
            format!("{case:12} {:10} {time:>7}  {effects}", text("verdict"))
        }
        Err(error) => format!("{case:12} {:10} {error}", "failed"),
    };
    if args.json {
        eprintln!("{}", line.trim_end());
    } else {
        println!("{}", line.trim_end());
    }
}

fn tell(args: &DiagnoseArgs, rows: &[&Row], kept: usize, table: &Path) {
    let mut verdicts: BTreeMap<&str, u64> = BTreeMap::new();
    for document in rows.iter().filter_map(|row| row.result.as_ref().ok()) {
        *verdicts.entry(document["verdict"].as_str().unwrap_or_default()).or_default() += 1;
    }
    let failed = rows.iter().filter_map(|row| Some((&row.case, row.result.as_ref().err()?)));
    let failed: Vec<Value> =
        failed.map(|(case, error)| json!({ "case": case, "error": error })).collect();
    if args.json {
        let document = json!({
            "schema": "kerbside.diagnose.batch.v1",
            "version": env!("CARGO_PKG_VERSION"),
            "seed": null,
            "passed": failed.is_empty(),
            "figures": [],
            "cases": rows.len(),
            "kept": kept,
            "shard": args.shard.map(|shard| shard.to_string()),
            "verdicts": verdicts,
            "failed": failed,
            "table": table,
        });
        println!("{document}");
        return;
    }
    let counts: Vec<String> =
        verdicts.iter().map(|(verdict, n)| format!("{n} {verdict}")).collect();
    println!("{} cases, {kept} kept: {}; {} failed", rows.len(), counts.join(", "), failed.len());
    println!("table      {}", table.display());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_share_all_cases_and_no_case_twice() {
        let folder = tempfile::tempdir().unwrap();
        for number in 0..10 {
            std::fs::create_dir_all(folder.path().join(format!("case{number}/runs"))).unwrap();
        }
        std::fs::create_dir_all(folder.path().join("notes")).unwrap();
        let out = Path::new("/out");
        let names = |shard: &str| {
            let shard = Some(parse_shard(shard).unwrap());
            let jobs = jobs(folder.path(), out, shard).unwrap();
            jobs.into_iter().map(|job| job.name).collect::<Vec<_>>()
        };
        let mut all: Vec<String> = ["1/3", "2/3", "3/3"].into_iter().flat_map(names).collect();
        all.sort();
        let expected: Vec<String> = (0..10).map(|number| format!("case{number}")).collect();
        assert_eq!(all, expected);
        assert!(names("4/20") == ["case3"] && names("12/20").is_empty());
    }

    #[test]
    fn a_shard_is_a_part_of_a_whole() {
        assert_eq!(parse_shard("2/3"), Ok(Shard { index: 2, of: 3 }));
        for bad in ["0/3", "4/3", "2", "a/b", "1/0", "-1/2"] {
            assert!(parse_shard(bad).unwrap_err().contains("I from 1 to N"), "{bad}");
        }
    }

    #[test]
    fn a_folder_without_cases_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let failure = jobs(folder.path(), Path::new("/out"), None).unwrap_err();
        assert_eq!(failure.exit, Exit::Data);
    }
}
