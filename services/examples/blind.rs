//! Draws cases on the proving ground, diagnoses them in this process and says for each what was put in and what was found:
//! for whoever works on the diagnosis.
//!
//! `cargo run --release -p kerbside --example blind -- --cases 60 --seed 1 [--only N] [--keep DIR] [--plant simulator] [--ideal]`
//!
//! `--ideal` takes away what a car in good order has of physics beyond the nominal vehicle: creep of the tyres, give and
//! geometry of the linkage.

use std::io::Write;
use std::time::Instant;

use kerbside::diagnose::Input;
use kerbside::trial::{Simulated, folder};
use kerbside_diagnosis::{Diagnosis, Settings, diagnose};
use kerbside_proving_ground::cases::{Build, Case, Drives, SecondVehicle, series};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().collect();
    let number = |name: &str| -> Option<u64> {
        let at = words.iter().position(|word| word == name)?;
        words.get(at + 1)?.parse().ok()
    };
    let (count, seed) = (number("--cases").unwrap_or(20), number("--seed").unwrap_or(1));
    let keep = words.iter().position(|word| word == "--keep").and_then(|at| words.get(at + 1));
    let has = |name: &str| words.iter().any(|word| word == name);
    let plant: &dyn Drives = if has("simulator") { &Simulated } else { &SecondVehicle };
    let all = series(seed, usize::try_from(count)?, |request| request);
    for (index, (seed, request)) in all.iter().enumerate() {
        if number("--only").is_some_and(|only| only != index as u64) {
            continue;
        }
        let Some(mut case) = Case::of(*seed, request) else { continue };
        if has("--ideal") {
            let build = case.specification.build;
            case.specification.build = ideal(build);
        }
        let place = tempfile::tempdir()?;
        let home = keep.map_or_else(|| place.path().to_owned(), std::path::PathBuf::from);
        let home = home.join(format!("case{index:03}"));
        folder::write(&home, &case, plant).map_err(|failure| format!("{failure:?}"))?;
        if keep.is_some() {
            std::fs::write(home.join("label.toml"), case.label().text())?;
        }
        let input = Input::read(&home).map_err(|failure| format!("{failure:?}"))?;
        let begin = Instant::now();
        let found = diagnose(&input.case, &Settings::default(), &|_, _| {});
        let seconds = begin.elapsed().as_secs_f64();
        let found = found.map_or_else(|error| error.to_string(), |found| told(&found));
        println!("{index:3} {} {seconds:.1} s {found}", truth(&case));
        std::io::stdout().flush()?;
    }
    Ok(())
}

/// The same without any physics of tyres and linkage.
fn ideal(build: Build) -> Build {
    Build {
        lateral_compliance: [0.0; 2],
        longitudinal_compliance: 0.0,
        rolling_resistance: 0.0,
        ackermann: 1.0,
        linkage: 0.0,
        toe: 0.0,
        gyro_latency: 0.0,
        ..build
    }
}

/// Kind, what was put in, and what the vehicle has.
fn truth(case: &Case) -> String {
    let label = case.label();
    let effects: Vec<String> = case
        .specification
        .effects
        .iter()
        .map(|effect| {
            let values: Vec<String> =
                effect.values.iter().map(|(name, value)| format!("{name} {value}")).collect();
            let wheel = effect.wheel.map_or("", |wheel| wheel.name());
            format!("{}({wheel}{})", effect.id, values.join(" "))
        })
        .collect();
    let vehicle = &case.specification.vehicle;
    let has = [
        ('c', vehicle.encoders.is_some()),
        ('s', vehicle.steering_sensor.is_some()),
        ('g', vehicle.gyro.is_some()),
        ('r', vehicle.reference.is_some()),
        ('y', case.specification.reference_yaw),
    ];
    let has: String = has.iter().filter(|known| known.1).map(|known| known.0).collect();
    let wheelbase = vehicle.wheelbase;
    format!("{:7} L {wheelbase} {has:5} {:60}", label.kind.name(), effects.join(" + "))
}

fn told(found: &Diagnosis) -> String {
    let effects: Vec<String> = found
        .effects
        .iter()
        .map(|effect| {
            let values: Vec<String> = effect
                .parameters
                .iter()
                .map(|parameter| {
                    let value = &parameter.value;
                    format!(
                        "{} {:.4} [{:.4} {:.4}]",
                        parameter.name, value.value, value.low, value.high
                    )
                })
                .collect();
            format!("{}({} {})", effect.id, effect.wheel.unwrap_or(""), values.join(" "))
        })
        .collect();
    let rivals: Vec<String> = found
        .ranking
        .iter()
        .take(4)
        .map(|rival| format!("{} {:.2}", rival.name, rival.probability))
        .collect();
    format!("-> {} {} | {}", found.verdict.name(), effects.join(" + "), rivals.join(", "))
}
