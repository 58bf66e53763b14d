//! Figures in rows.

use kerbside_geometry::Pose;

use super::data::{Event, EventKind, Latency, ParkReport, ProcessFigures};
use crate::format::{self, UNKNOWN};
use crate::page::{KeyFigure, Row, Table};
use crate::svg::Tone;

impl ParkReport {
    /// The end error that was judged, and what it is called.
    pub(super) fn judged_error(&self) -> Option<Pose> {
        self.figures.end_error.or(self.figures.estimate_error)
    }

    pub(super) fn key_figures(&self) -> Vec<KeyFigure> {
        let figures = &self.figures;
        let mut cards = self.end_pose_cards();
        cards.push(self.clearance_card());
        cards.push(KeyFigure::plain(
            "Gear changes",
            figures.gear_changes.to_string(),
            &format!("{} driven", format::metres(figures.path_length)),
        ));
        cards.push(KeyFigure::plain(
            "Duration",
            format::seconds(figures.duration),
            "from the first command",
        ));
        cards.extend(self.latency.as_ref().map(latency_card));
        let late = figures.deadline_misses > 0 || figures.restarts > 0;
        cards.push(KeyFigure {
            tone: if late { Tone::Warn } else { Tone::Plain },
            ..KeyFigure::plain(
                "Deadline misses",
                format::count(figures.deadline_misses),
                &format::plural(u64::from(figures.restarts), "restart", "restarts"),
            )
        });
        cards
    }

    fn end_pose_cards(&self) -> Vec<KeyFigure> {
        let Some(end) = self.judged_error() else {
            return vec![KeyFigure::plain("End pose", UNKNOWN.to_owned(), "not known")];
        };
        let limit = &self.scene.tolerance;
        let note = |limit: String| format!("of at most {limit}");
        let length = |metres: f64| format::with_unit(&format::three_digits(metres * 1e3), "mm");
        let turn = |radians: f64| {
            let degrees = kerbside_geometry::angle::degrees(radians);
            format::with_unit(&format::three_digits(degrees), "deg")
        };
        let (along, across) = (format::millimetres(end.x), format::millimetres(end.y));
        vec![
            KeyFigure::limited("End error along", along, end.x, limit.x, &note(length(limit.x))),
            KeyFigure::limited("End error across", across, end.y, limit.y, &note(length(limit.y))),
            KeyFigure::limited(
                "End error heading",
                format::degrees(end.yaw),
                end.yaw,
                limit.yaw,
                &note(turn(limit.yaw)),
            ),
        ]
    }

    fn clearance_card(&self) -> KeyFigure {
        let figures = &self.figures;
        let clearance = figures.driven_clearance.or(figures.planned_clearance);
        let note = match (figures.driven_clearance, figures.planned_clearance) {
            (Some(_), Some(planned)) => format!("planned {}", plain_millimetres(planned)),
            (Some(_), None) => "driven".to_owned(),
            _ => "planned".to_owned(),
        };
        let tone = match figures.driven_clearance {
            _ if self.outcome.collision => Tone::Bad,
            Some(driven) => Tone::of(driven > 0.0),
            None => Tone::Plain,
        };
        let value = format::optional(clearance, plain_millimetres);
        KeyFigure { tone, ..KeyFigure::plain("Least clearance", value, &note) }
    }

    pub(super) fn error_table(&self) -> Table {
        let figures = &self.figures;
        let rows = [
            ("Truth against goal", figures.end_error),
            (self.estimate_row_name(), figures.estimate_error),
        ];
        let mut table = Table::new("End pose", &["", "#along", "#across", "#heading"], "");
        for (name, error) in rows {
            table.rows.push(pose_row(name, error));
        }
        let limit = &self.scene.tolerance;
        table.rows.push(Row::new([
            "Tolerance".to_owned(),
            format!("\u{b1}{}", plain_millimetres(limit.x)),
            format!("\u{b1}{}", plain_millimetres(limit.y)),
            format!("\u{b1}{}", format::degrees(limit.yaw).trim_start_matches('+')),
        ]));
        table
    }

    fn estimate_row_name(&self) -> &'static str {
        if self.figures.end_error.is_some() {
            "Estimate against truth"
        } else {
            "Estimate against goal"
        }
    }

    pub(super) fn figure_table(&self) -> Table {
        let figures = &self.figures;
        let rows = [
            ("Gear changes", figures.gear_changes.to_string()),
            ("Duration", format::seconds(figures.duration)),
            ("Length of the path", format::metres(figures.path_length)),
            (
                "Clearance, certified",
                format::optional(figures.planned_clearance, plain_millimetres),
            ),
            ("Clearance, driven", format::optional(figures.driven_clearance, plain_millimetres)),
            ("Collision", if self.outcome.collision { "yes" } else { "no" }.to_owned()),
            ("Deadline misses", format::count(figures.deadline_misses)),
            ("Restarts", figures.restarts.to_string()),
        ];
        let rows = rows.into_iter().map(|(name, value)| Row::new([name.to_owned(), value]));
        Table::new("Manoeuvre", &["", "#"], "").with_rows(rows)
    }

    pub(super) fn event_table(&self) -> Table {
        Table::new("", &["#time", "kind", "what"], "Nothing to report.")
            .with_rows(self.events.iter().map(event_row))
    }

    pub(super) fn process_table(&self) -> Table {
        let columns =
            ["process", "#pid", "#restarts", "#deadline misses", "#mean step", "#longest step"];
        Table::new("", &columns, "No process reported.")
            .with_rows(self.processes.iter().map(process_row))
    }
}

fn plain_millimetres(metres: f64) -> String {
    format::with_unit(&format::fixed(metres * 1e3, 1), "mm")
}

fn pose_row(name: &str, error: Option<Pose>) -> Row {
    let length = |metres: fn(&Pose) -> f64| {
        format::optional(error.as_ref().map(metres), format::millimetres)
    };
    let heading = format::optional(error.map(|error| error.yaw), format::degrees);
    Row::new([name.to_owned(), length(|error| error.x), length(|error| error.y), heading])
}

fn latency_card(latency: &Latency) -> KeyFigure {
    let note = format!("p99 {}", format::duration(latency.p99));
    KeyFigure::plain("Latency, median", format::duration(latency.p50), &note)
}

pub(super) fn latency_table(latency: &Latency) -> Table {
    let samples: u64 = latency.counts.iter().map(|entry| entry.1).sum();
    let columns = ["#p50", "#p99", "#p99.9", "#longest", "#deadline", "#samples"];
    let row = Row::new([
        format::duration(latency.p50),
        format::duration(latency.p99),
        format::duration(latency.p999),
        format::duration(latency.max),
        format::optional(latency.deadline, format::duration),
        format::count(samples),
    ]);
    Table::new("Encoder reading to command", &columns, "").with_rows([row])
}

fn event_row(event: &Event) -> Row {
    let (kind, tone) = match event.kind {
        EventKind::Mode => ("mode", Tone::Plain),
        EventKind::Arm => ("arm", Tone::Plain),
        EventKind::Plan => ("plan", Tone::Plain),
        EventKind::Fault => ("fault", Tone::Bad),
        EventKind::Restart => ("restart", Tone::Warn),
        EventKind::Note => ("note", Tone::Plain),
    };
    let time = format::with_unit(&format::fixed(event.time, 3), "s");
    Row::new([time, kind.to_owned(), event.text.clone()]).toned(tone)
}

fn process_row(process: &ProcessFigures) -> Row {
    let pid = process.pid.map_or_else(|| UNKNOWN.to_owned(), |pid| pid.to_string());
    Row::new([
        process.name.clone(),
        pid,
        process.restarts.to_string(),
        format::count(process.misses),
        format::duration(process.work_mean),
        format::duration(process.work_max),
    ])
}
