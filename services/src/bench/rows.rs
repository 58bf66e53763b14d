//! What a bench says: rows of ours against a rival, as a table or as JSON.

use comfy_table::Table;
use serde_json::{Value, json};

use super::statistics::{Blocks, Estimate};
use crate::exit::Exit;
use crate::figures::Figure;
use crate::tables;

/// Ours beside a rival.
#[derive(Clone, Debug)]
pub struct Row {
    /// What was measured.
    pub name: String,
    /// Bytes of the payload.
    pub bytes: usize,
    /// Ours: p50 of everything, p99 of a block in the middle of blocks \[us\].
    pub ours: (f64, f64),
    /// The rival's name.
    pub rival: String,
    /// The same of the rival \[us\].
    pub rivals: (f64, f64),
    /// Ours over the rival's, p50.
    pub ratio: Estimate,
}

impl Row {
    /// A row of latencies.
    #[must_use]
    pub fn of(name: &str, bytes: usize, ours: &Blocks, rival: &str, rivals: &Blocks) -> Self {
        let both = |blocks: &Blocks| (blocks.percentile(0.5), blocks.percentile_of_a_block(0.99));
        Self {
            name: name.to_owned(),
            bytes,
            ours: both(ours),
            rival: rival.to_owned(),
            rivals: both(rivals),
            ratio: ours.ratio(rivals),
        }
    }

    /// Ours over the rival's at p99.
    #[must_use]
    pub fn ratio_p99(&self) -> f64 {
        self.ours.1 / self.rivals.1
    }

    /// The figures of a row that is held against a limit at p50 and, where there is one, at p99.
    #[must_use]
    pub fn figures(&self, limit: f64, limit_p99: Option<f64>) -> Vec<Figure> {
        let name = |percentile: &str| format!("{} against {}, {percentile}", self.name, self.rival);
        let Estimate { value, low, high } = self.ratio;
        let p50 = Figure::at_most(&name("p50"), value, limit).within(low, high);
        let p99 = limit_p99.map(|limit| Figure::at_most(&name("p99"), self.ratio_p99(), limit));
        core::iter::once(p50).chain(p99).collect()
    }

    fn as_json(&self) -> Value {
        let Estimate { value, low, high } = self.ratio;
        json!({
            "name": self.name, "bytes": self.bytes,
            "ours_us": self.ours.0, "ours_p99_us": self.ours.1,
            "rival": self.rival, "rival_us": self.rivals.0, "rival_p99_us": self.rivals.1,
            "ratio_p50": { "value": value, "low": low, "high": high }, "ratio_p99": self.ratio_p99(),
        })
    }
}

/// Everything a bench says.
#[derive(Debug)]
pub struct Told {
    /// Which bench.
    pub verb: &'static str,
    /// Its rows.
    pub rows: Vec<Row>,
    /// What it is held against.
    pub figures: Vec<Figure>,
    /// Sentences for people.
    pub notes: Vec<String>,
    /// Keys of its own in the JSON object.
    pub more: Value,
}

/// Tells, and judges.
pub fn tell(told: &Told, as_json: bool) -> Exit {
    kerbside_runtime::end_on_broken_pipe();
    let passed = told.figures.iter().all(Figure::passed);
    if as_json {
        println!("{}", object(told, passed));
    } else {
        print(told);
    }
    if passed { Exit::Good } else { Exit::Bad }
}

fn object(told: &Told, passed: bool) -> Value {
    let mut object = json!({
        "schema": format!("kerbside.bench.{}.v1", told.verb), "version": env!("CARGO_PKG_VERSION"), "seed": null,
        "passed": passed, "figures": told.figures.iter().map(Figure::as_json).collect::<Vec<_>>(),
        "rows": told.rows.iter().map(Row::as_json).collect::<Vec<_>>(), "notes": told.notes,
        "machine": crate::machine::facts().into_iter().map(|(name, value)| (name, json!(value)))
            .collect::<serde_json::Map<_, _>>(),
    });
    if let (Some(object), Some(more)) = (object.as_object_mut(), told.more.as_object()) {
        object.extend(more.clone());
    }
    object
}

fn print(told: &Told) {
    if !told.rows.is_empty() {
        println!("{}", table(&told.rows));
    }
    told.notes.iter().for_each(|note| println!("{note}"));
    told.figures.iter().for_each(|figure| println!("{figure}"));
}

fn table(rows: &[Row]) -> Table {
    let header = ["", "p50 us", "p99 us", "against", "p50 us", "ratio (95 %)", "at p99"];
    let mut table = tables::figures(&header, &[1, 2, 4, 5, 6]);
    for row in rows {
        let Estimate { value, low, high } = row.ratio;
        let name = match row.bytes {
            0 => row.name.clone(),
            bytes => format!("{}, {bytes} B", row.name),
        };
        table.add_row([
            name,
            format!("{:.1}", row.ours.0),
            format!("{:.1}", row.ours.1),
            row.rival.clone(),
            format!("{:.1}", row.rivals.0),
            format!("{value:.2} ({low:.2}-{high:.2})"),
            format!("{:.2}", row.ratio_p99()),
        ]);
    }
    table
}
