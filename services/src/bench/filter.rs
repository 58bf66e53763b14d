//! `bench filter`: a step of the pose filter against its twin in C++ with Eigen.
//!
//! A step is one prediction of three states and one gated correction by a measured pose. The twin is compiled where a
//! C++ compiler and Eigen are; blocks of the two take turns, and what they compute is compared.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use kerbside_odometry::{Estimate, Increment};
use kerbside_runtime::{RealtimeRequest, enter_realtime, now};
use nalgebra::{Matrix2, Matrix3, Vector3};
use serde_json::json;

use super::rows::{Told, tell};
use super::statistics::{median, median_of};
use crate::exit::{Exit, Failure};
use crate::figures::Figure;
use crate::output;

/// The twin's source.
const TWIN: &str = include_str!("twin.cpp");
/// A step may take so many times the twin's.
const LIMIT: f64 = 1.2;
/// Where Debian's package puts Eigen, and where one installs it by hand.
const EIGEN: [&str; 2] = ["/usr/include/eigen3", "/usr/local/include/eigen3"];
/// Largest difference of what the two computed, of the pose's magnitude: their sines differ by a last bit.
const AGREEMENT: f64 = 1e-9;

/// What `bench filter` is asked.
#[derive(Clone, Debug, clap::Args)]
pub struct FilterArgs {
    /// Interleaved blocks of each.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(2..))]
    blocks: u32,
    /// Steps of a block.
    #[arg(long, default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1000..))]
    steps: u32,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] where the twin is there but does not run, or computes something else.
pub fn run(args: &FilterArgs) -> Result<Exit, Failure> {
    // Both on one core: two cores of a machine that others use are seldom equally fast.
    let cores = kerbside_runtime::last_core().into_iter().collect();
    let _ = enter_realtime(&RealtimeRequest { cores, ..RealtimeRequest::default() });
    let folder = std::env::temp_dir().join(format!("kerbside-bench-{}", output::stamp()));
    let folder = output::folder(Some(&folder), "bench")?;
    let measured = Twin::build(&folder).and_then(|twin| measure(args, twin));
    fs::remove_dir_all(&folder).map_err(Failure::internal)?;
    Ok(tell(&measured?, args.json))
}

fn measure(args: &FilterArgs, twin: Result<Twin, String>) -> Result<Told, Failure> {
    let (mut twin, skipped) = match twin {
        Ok(twin) => (Some(twin), None),
        Err(why) => (None, Some(format!("the twin is skipped: {why}"))),
    };
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for _ in 0..args.blocks {
        let own = Block::of_ours(args.steps);
        ours.push(own.nanos);
        if let Some(twin) = &mut twin {
            let other = twin.block(args.steps)?;
            own.agree_with(&other)?;
            theirs.push(other.nanos);
        }
    }
    if let Some(twin) = twin {
        twin.end()?;
    }
    let own = median(ours.clone());
    let mut told = Told {
        verb: "filter",
        rows: Vec::new(),
        figures: Vec::new(),
        notes: vec![format!("a step: median {own:.0} ns over {} blocks", args.blocks)],
        more: json!({ "step_ns": own, "twin_ns": null, "twin": skipped }),
    };
    told.notes.extend(skipped);
    if !theirs.is_empty() {
        let pairs: Vec<_> = ours.iter().zip(&theirs).map(|(own, other)| own / other).collect();
        let ratio = median_of(&pairs);
        let name = "a filter step against the twin in C++, p50";
        told.figures.push(Figure::at_most(name, ratio.value, LIMIT).within(ratio.low, ratio.high));
        told.notes.push(format!("the twin: median {:.0} ns", median(theirs.clone())));
        told.more["twin_ns"] = json!(median(theirs));
    }
    Ok(told)
}

/// What a block of steps took, and where it led.
struct Block {
    /// Of one step \[ns\].
    nanos: f64,
    taken: u32,
    figures: [f64; 3],
}

impl Block {
    /// The same motions and innovations as the twin's.
    fn of_ours(steps: u32) -> Self {
        let mut estimate =
            Estimate { covariance: Matrix3::identity() * 1e-6, ..Estimate::default() };
        let covariance = Matrix2::new(5e-10, 0.0, 0.0, 2e-8);
        let noise = Matrix3::from_diagonal(&Vector3::new(1e-8, 1e-8, 4e-7));
        let none = Matrix3::zeros();
        let (mut random, mut taken) = (1_u32, 0);
        let begun = now();
        for _ in 0..steps {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let share = f64::from(random) / 4_294_967_296.0 - 0.5;
            estimate.roll(&Increment {
                distance: 1e-3 * (1.0 + share),
                turn: 4e-3 * share,
                covariance,
            });
            let innovation = Vector3::new(2e-5 * share, -1e-5 * share, 1e-4 * share);
            let ratio = estimate.update(&innovation, &noise, &none, 11.345);
            taken += u32::from(ratio.is_some_and(|ratio| ratio <= 11.345));
        }
        #[allow(clippy::cast_precision_loss)] // milliseconds
        let nanos = (now() - begun) as f64 / f64::from(steps);
        let figures = [estimate.pose.x, estimate.pose.y, estimate.covariance.trace()];
        Self { nanos, taken, figures }
    }

    fn agree_with(&self, other: &Self) -> Result<(), Failure> {
        let near = |(ours, theirs): (&f64, &f64)| {
            (ours - theirs).abs() <= AGREEMENT * ours.abs().max(theirs.abs())
        };
        if self.taken == other.taken && self.figures.iter().zip(&other.figures).all(near) {
            return Ok(());
        }
        let words = format!("the twin computes {:?}, the filter {:?}", other.figures, self.figures);
        Err(Failure::internal(words))
    }
}

/// The twin's process.
struct Twin {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
}

impl Twin {
    /// Compiles and starts it; the reason where this machine cannot.
    fn build(folder: &Path) -> Result<Result<Self, String>, Failure> {
        let Some(eigen) = EIGEN.map(PathBuf::from).into_iter().find(|path| path.is_dir()) else {
            return Ok(Err(format!("no Eigen in {}", EIGEN.join(" or "))));
        };
        let (source, binary) = (folder.join("twin.cpp"), folder.join("twin"));
        output::write(&source, TWIN)?;
        let compiled = Command::new("g++")
            .args(["-O3", "-DNDEBUG", "-std=c++17", "-I"])
            .arg(eigen)
            .arg("-o")
            .args([&binary, &source])
            .output();
        match compiled {
            Err(error) => return Ok(Err(format!("g++: {error}"))),
            Ok(output) if !output.status.success() => {
                return Err(Failure::internal(String::from_utf8_lossy(&output.stderr)));
            }
            Ok(_) => {}
        }
        let mut child = Command::new(&binary)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(Failure::internal)?;
        match (child.stdin.take(), child.stdout.take()) {
            (Some(to), Some(from)) => Ok(Ok(Self { child, to, from: BufReader::new(from) })),
            _ => Err(Failure::internal("no pipes to the twin")),
        }
    }

    fn block(&mut self, steps: u32) -> Result<Block, Failure> {
        writeln!(self.to, "{steps}").map_err(Failure::internal)?;
        let mut line = String::new();
        self.from.read_line(&mut line).map_err(Failure::internal)?;
        let numbers: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
        match numbers.as_deref() {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count of steps
            Ok([nanos, taken, x, y, trace]) => Ok(Block {
                nanos: nanos / f64::from(steps),
                taken: *taken as u32,
                figures: [*x, *y, *trace],
            }),
            _ => Err(Failure::internal(format!("the twin answers {line:?}"))),
        }
    }

    fn end(self) -> Result<(), Failure> {
        let Self { mut child, to, from } = self;
        drop((to, from));
        child.wait().map(|_| ()).map_err(Failure::internal)
    }
}
