//! The filters on recorded runs.

use kerbside_recordings::input::Source;
use serde_json::{Value, json};

use super::{FILTERS, FiltersArgs, name};
use crate::exit::{Exit, Failure};
use crate::output;
use crate::replay::{Filtered, ReplayArgs, by_filters, find};
use crate::tables;

/// Replays every run with every filter and tells.
///
/// # Errors
/// [`Failure`] where an input is refused.
pub(super) fn run(args: &FiltersArgs) -> Result<Exit, Failure> {
    let folder = output::folder(args.out.as_deref(), "compare")?;
    let mut all: Vec<Filtered> = Vec::new();
    for path in &args.paths {
        let asked = ReplayArgs {
            path: path.clone(),
            speed: None,
            pure: true,
            fixes: None,
            fix_rate: 1.0,
            vehicle: args.vehicle.clone(),
            config: args.config.clone(),
            instance: None,
            out: None,
            json: args.json,
            log: None,
        };
        let sources: Vec<Source> = find(path)?;
        for source in &sources {
            let folder = folder.join(format!("{}", all.len() + 1));
            all.push(by_filters(&asked, source, &folder, &FILTERS)?);
        }
    }
    kerbside_runtime::end_on_broken_pipe();
    if args.json {
        println!("{}", as_json(&all));
    } else {
        print(&all);
    }
    Ok(Exit::Good)
}

fn as_json(all: &[Filtered]) -> Value {
    let runs = all.iter().map(|one| {
        let filters = one.drifts.iter().map(|drift| {
            let figures = drift.drift.map(|(percent, heading, end)| {
                json!({
                    "position_percent": percent, "heading_rad_per_m": heading,
                    "end_error": { "x": end.x, "y": end.y, "yaw": end.yaw },
                })
            });
            json!({ "filter": name(drift.filter), "drift": figures })
        });
        json!({
            "input": one.input, "name": one.name, "distance_m": one.distance, "why": one.why, "notes": one.notes,
            "filters": filters.collect::<Vec<_>>(),
        })
    });
    json!({
        "schema": "kerbside.compare-filters.v1",
        "version": env!("CARGO_PKG_VERSION"),
        "seed": Value::Null,
        "passed": true,
        "figures": [],
        "runs": runs.collect::<Vec<_>>(),
    })
}

/// A column per filter: drift and the end's error.
fn print(all: &[Filtered]) {
    let header: Vec<&str> = ["run", "m"].into_iter().chain(FILTERS.map(name)).collect();
    let numbers: Vec<usize> = (1..header.len()).collect();
    let mut table = tables::figures(&header, &numbers);
    for one in all {
        let cells = one.drifts.iter().map(|drift| {
            drift.drift.map_or("-".to_owned(), |(percent, _, end)| {
                format!("{percent:.2} {:.3}", end.x.hypot(end.y))
            })
        });
        let first = [one.name.clone(), format!("{:.1}", one.distance)];
        table.add_row(first.into_iter().chain(cells));
    }
    println!("{table}");
    println!("position drift [% of the distance], median over windows;");
    println!("position error at the end [m]");
    for one in all {
        one.why.iter().for_each(|why| println!("{}: no drift: {why}", one.name));
        one.notes.iter().for_each(|note| println!("{}: {note}", one.name));
    }
}
