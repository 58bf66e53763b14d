//! Tables of figures.

use kerbside_geometry::{Pose, angle, math};
use kerbside_reproduction::{
    Accept, Contender, Ends, Figure, Parkings, Reproduction, Slipped, Verdict,
};

use super::data::StackParking;
use crate::format;
use crate::page::{Row, Table};
use crate::svg::Tone;

/// A number with the digits that it needs, and its unit.
pub(super) fn number(value: f64, unit: &str) -> String {
    let size = value.abs();
    let text = if size >= 1e6 || (size > 0.0 && size < 1e-3) {
        format!("{value:.1e}")
    } else {
        let decimals = if size >= 100.0 { 1 } else { 3 };
        format::fixed(value, decimals)
    };
    if unit.is_empty() { text } else { format::with_unit(&text, unit) }
}

fn accepted(accept: Accept) -> String {
    let number = |value| number(value, "");
    match accept {
        Accept::AtMost(limit) => format!("at most {}", number(limit)),
        Accept::AtLeast(limit) => format!("at least {}", number(limit)),
        Accept::Within(low, high) => format!("{} to {}", number(low), number(high)),
        Accept::Shown => String::new(),
    }
}

fn interval(figure: &Figure) -> String {
    let (low, high) = figure.interval;
    if low == high { String::new() } else { format!("{} to {}", number(low, ""), number(high, "")) }
}

/// The figures of a row, those that are held and those that are shown beside.
pub(super) fn figures(reproduction: &Reproduction, row: u8, held: bool) -> Table {
    let columns = ["figure", "#paper", "#here", "#95 % interval", "accepted", ""];
    let of_row = |figure: &&Figure| figure.row == row && figure.is_held() == held;
    let rows = reproduction.figures.iter().filter(of_row).map(|figure| {
        let verdict = reproduction.verdict(figure);
        let (word, tone) = match verdict {
            _ if !held => ("", Tone::Plain),
            Verdict::Reached => ("reached", Tone::Good),
            Verdict::Open => ("open", Tone::Warn),
            Verdict::Missed => ("missed", Tone::Bad),
        };
        Row::new([
            figure.name.clone(),
            figure.paper.to_owned(),
            number(figure.ours, figure.unit),
            interval(figure),
            accepted(figure.accept),
            word.to_owned(),
        ])
        .toned(tone)
    });
    let caption = if held { "Held" } else { "Shown beside" };
    Table::new(caption, &columns, "").with_rows(rows)
}

/// Mean error, variance ratio and NEES per contender and case.
pub(super) fn ends(ends: &[Ends]) -> Table {
    let columns = ["case", "filter", "#mean error", "#variance/rear", "#NEES/3"];
    let rows = ends.iter().flat_map(|case| {
        case.spreads.iter().map(|spread| {
            let contender = spread.contender;
            let ratio = case.variance_ratio(contender, Contender::Rear).0;
            Row::new([
                case.name(),
                contender.name().to_owned(),
                format::with_unit(&format::fixed(1e3 * case.mean_error(contender), 1), "mm"),
                format::fixed(ratio, 3),
                number(spread.nees_share(), ""),
            ])
        })
    });
    Table::new("End of the S path; the paper's ratio is 0.66", &columns, "").with_rows(rows)
}

/// Mean end errors with slips.
pub(super) fn slips(lines: &[Slipped]) -> Table {
    let columns =
        ["slip", "#speed", "parameters", "#rear", "#front", "#paper (ii)", "#fused", "#found"];
    let rows = lines.iter().map(|line| {
        let mean = |contender| {
            let error = 1e3 * line.mean_error(contender);
            format::with_unit(&format::fixed(error, 1), "mm")
        };
        let found = line.of(Contender::Fused).map_or(f64::NAN, |fused| {
            #[allow(clippy::cast_precision_loss)] // drives
            let share = fused.flags() as f64 / fused.flagged.len() as f64;
            share
        });
        Row::new([
            line.name.to_owned(),
            format::with_unit(&format::fixed(1e3 * line.speed, 0), "mm/s"),
            line.knowledge.to_owned(),
            mean(Contender::Rear),
            mean(Contender::Front),
            mean(Contender::Paper),
            mean(Contender::Fused),
            format::percent(found),
        ])
    });
    Table::new("Mean end error", &columns, "").with_rows(rows)
}

/// Table 3 beside the paper's.
pub(super) fn parking(lines: &[Parkings], stack: &[StackParking]) -> Table {
    let columns = ["manoeuvre", "by", "#x mean|abs", "#y mean|abs", "#heading mean|abs", "#inside"];
    let paper = [
        ["garage", "the paper", "\u{2212}12.4 mm", "\u{2212}23.8 mm", "1.22 deg", ""],
        ["parallel", "the paper", "\u{2212}17.5 mm", "+11.2 mm", "0.62 deg", ""],
    ];
    let printed = paper.into_iter().map(Row::new);
    let ours = lines.iter().map(|line| {
        let both = |axis: usize, scale: f64| {
            let (mean, size) = (line.mean(axis), line.mean_abs(axis));
            format!("{} | {}", format::signed(scale * mean, 1), format::fixed(scale * size, 1))
        };
        let turn = format!(
            "{} | {}",
            format::signed(angle::degrees(line.mean(2)), 2),
            format::fixed(angle::degrees(line.mean_abs(2)), 2)
        );
        #[allow(clippy::cast_precision_loss)] // parkings
        let inside = line.inside() as f64 / line.ends.len() as f64;
        Row::new([
            line.scene.name().to_owned(),
            line.driver.name().to_owned(),
            format::with_unit(&both(0, 1e3), "mm"),
            format::with_unit(&both(1, 1e3), "mm"),
            format::with_unit(&turn, "deg"),
            format::percent(inside),
        ])
    });
    let stack = stack.iter().map(|line| {
        let mean = |of: &dyn Fn(&Pose) -> f64| {
            #[allow(clippy::cast_precision_loss)] // parkings
            let count = line.ends.len() as f64;
            line.ends.iter().map(|end| end.as_ref().map_or(f64::NAN, of)).sum::<f64>() / count
        };
        let lengths = |of: fn(&Pose) -> f64| {
            let (mean, size) = (1e3 * mean(&of), 1e3 * mean(&|pose| of(pose).abs()));
            format::with_unit(
                &format!("{} | {}", format::signed(mean, 1), format::fixed(size, 1)),
                "mm",
            )
        };
        let turn = |of: &dyn Fn(&Pose) -> f64| angle::degrees(mean(of));
        let turn = format!(
            "{} | {}",
            format::signed(turn(&|pose| pose.yaw), 2),
            format::fixed(turn(&|pose| pose.yaw.abs()), 2)
        );
        Row::new([
            line.scene.clone(),
            format!("the stack, {}", line.mode),
            lengths(|pose| pose.x),
            lengths(|pose| pose.y),
            format::with_unit(&turn, "deg"),
            format!("{} of {} parked", line.parked, line.ends.len()),
        ])
    });
    let rows = printed.chain(ours).chain(stack);
    Table::new("Ends against the goal, true", &columns, "").with_rows(rows)
}

/// Length of the mean of some ends \[m\].
pub(super) fn mean_length(ends: &[Pose]) -> f64 {
    #[allow(clippy::cast_precision_loss)] // ends
    let count = ends.len() as f64;
    let mean = |of: fn(&Pose) -> f64| ends.iter().map(of).sum::<f64>() / count;
    math::hypot(mean(|pose| pose.x), mean(|pose| pose.y))
}
