//! The filters on the proving ground's S path.

use kerbside_reproduction::{Asked, Contender, Ends, Reproduction, Verdict, reproduce};
use serde_json::{Value, json};

use super::FiltersArgs;
use crate::exit::{Exit, Failure};
use crate::reproduce::{figure_as_json, short, watched};
use crate::tables;

/// The row of acceptance that asks for this comparison.
const ENDS: u8 = 6;

/// Drives the S path and tells.
///
/// # Errors
/// [`Failure`] where somebody interrupts it.
pub(super) fn run(args: &FiltersArgs) -> Result<Exit, Failure> {
    let asked = Asked { trials: args.trials as usize, seed: args.seed, rows: vec![ENDS] };
    let out = watched(|watcher| reproduce(&asked, watcher))?;
    kerbside_runtime::end_on_broken_pipe();
    if args.json {
        println!("{}", as_json(args, &out));
    } else {
        print(&out);
    }
    Ok(if out.passed() { Exit::Good } else { Exit::Bad })
}

fn as_json(args: &FiltersArgs, out: &Reproduction) -> Value {
    let held = out.figures.iter().filter(|figure| figure.is_held());
    json!({
        "schema": "kerbside.compare-filters.v1",
        "version": env!("CARGO_PKG_VERSION"),
        "seed": args.seed,
        "trials": args.trials,
        "passed": out.passed(),
        "figures": held.map(|figure| figure_as_json(out, figure)).collect::<Vec<_>>(),
        "cases": out.ends.iter().map(case_as_json).collect::<Vec<_>>(),
    })
}

fn case_as_json(case: &Ends) -> Value {
    let filters = case.spreads.iter().map(|spread| {
        let (ratio, (low, high)) = case.variance_ratio(spread.contender, Contender::Rear);
        json!({
            "filter": spread.contender.name(), "mean_error_m": case.mean_error(spread.contender),
            "variance_m2": case.variance(spread.contender),
            "variance_over_rear": { "value": ratio, "low": low, "high": high },
            "nees_over_3": spread.nees_share(),
        })
    });
    json!({
        "case": case.name(), "speed": case.speed, "parameters": case.knowledge.name(),
        "filters": filters.collect::<Vec<_>>(),
    })
}

fn print(out: &Reproduction) {
    for case in &out.ends {
        println!("{}", case.name());
        let header = ["filter", "mean mm", "var mm^2", "/rear", "95 %", "NEES/3"];
        let mut table = tables::figures(&header, &[1, 2, 3, 5]);
        for spread in &case.spreads {
            let contender = spread.contender;
            let (ratio, (low, high)) = case.variance_ratio(contender, Contender::Rear);
            table.add_row([
                contender.name().to_owned(),
                format!("{:.1}", 1e3 * case.mean_error(contender)),
                format!("{:.0}", 1e6 * case.variance(contender)),
                format!("{ratio:.3}"),
                format!("{low:.3}..{high:.3}"),
                short(spread.nees_share()),
            ]);
        }
        println!("{table}");
    }
    for figure in out.figures.iter().filter(|figure| out.verdict(figure) != Verdict::Reached) {
        let word = if out.verdict(figure) == Verdict::Open { "open" } else { "missed" };
        println!("{word}: {}\n        {}", figure.name, short(figure.ours));
    }
    println!("{} trials per case, seed {}", out.asked.trials, out.asked.seed);
}
