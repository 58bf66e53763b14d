//! Distributions of short times on logarithmic axes.

use super::{Chart, Dash, Figure, Ink, Line, Mark, Range, Ticks, Trace, Weight};
use crate::format::{exp10, log10};

/// Bars per decade of a histogram.
const BARS: f64 = 12.0;

/// How often a time was seen, both axes logarithmic, so that the rare late one is as visible as the
/// many.
///
/// `counts` are (time \[s\], how often), in any order; times that are not positive are passed over.
#[must_use]
pub fn latency_histogram(id: &str, title: &str, counts: &[(f64, u64)], marks: Vec<Mark>) -> Figure {
    let counts = sorted(counts);
    let bars = bars(&counts);
    let most = bars.iter().map(|bar| bar[2]).fold(1.0, f64::max);
    let chart = Chart {
        id: id.to_owned(),
        title: title.to_owned(),
        description: describe("Histogram", &counts),
        x_title: "latency".to_owned(),
        y_title: "samples".to_owned(),
        x_ticks: Ticks::LogDuration,
        y_ticks: Ticks::LogCount,
        x_range: decades(&counts, &marks),
        y_range: Some(Range::new(0.7, most * 2.0)),
        bars,
        marks,
        ..Chart::default()
    };
    chart.figure()
}

/// Which share of the samples took longer than a time: the tail, both axes logarithmic.
#[must_use]
pub fn latency_tail(id: &str, title: &str, counts: &[(f64, u64)], marks: Vec<Mark>) -> Figure {
    let counts = sorted(counts);
    let points = tail(&counts);
    let lowest = points.iter().map(|point| point[1]).filter(|share| *share > 0.0);
    let lowest = lowest.fold(0.1, f64::min);
    let line = Line { ink: Ink::Blue, dash: Dash::Solid, weight: Weight::Normal };
    let chart = Chart {
        id: id.to_owned(),
        title: title.to_owned(),
        description: describe("Share of samples above a time", &counts),
        x_title: "latency".to_owned(),
        y_title: "share that took longer".to_owned(),
        x_ticks: Ticks::LogDuration,
        y_ticks: Ticks::LogShare,
        x_range: decades(&counts, &marks),
        y_range: Some(Range::new(exp10(log10(lowest * 0.999).floor()), 1.5)),
        traces: vec![Trace { label: String::new(), line, points }],
        marks,
        ..Chart::default()
    };
    chart.figure()
}

fn sorted(counts: &[(f64, u64)]) -> Vec<(f64, u64)> {
    let is_usable = |entry: &&(f64, u64)| entry.0.is_finite() && entry.0 > 0.0 && entry.1 > 0;
    let mut counts: Vec<_> = counts.iter().filter(is_usable).copied().collect();
    counts.sort_by(|a, b| a.0.total_cmp(&b.0));
    counts
}

fn bars(counts: &[(f64, u64)]) -> Vec<[f64; 3]> {
    let bin = |time: f64| (BARS * log10(time)).floor();
    counts
        .chunk_by(|a, b| bin(a.0) == bin(b.0))
        .map(|chunk| {
            let left = bin(chunk[0].0);
            let height: u64 = chunk.iter().map(|entry| entry.1).sum();
            [exp10(left / BARS), exp10((left + 1.0) / BARS), height as f64]
        })
        .collect()
}

/// Steps of the share above, drawn as a staircase; ends where one sample is left.
fn tail(counts: &[(f64, u64)]) -> Vec<[f64; 2]> {
    let total: u64 = counts.iter().map(|entry| entry.1).sum();
    let mut above = total;
    let mut points = Vec::with_capacity(2 * counts.len());
    for (time, count) in counts {
        points.push([*time, above as f64 / total as f64]);
        above -= count;
        if above > 0 {
            points.push([*time, above as f64 / total as f64]);
        }
    }
    points
}

/// Whole decades around times and marks, at least from 10 us to 1 ms.
fn decades(counts: &[(f64, u64)], marks: &[Mark]) -> Option<Range> {
    let marked = marks.iter().map(|mark| mark.x).filter(|time| *time > 0.0);
    let covered = Range::covering(counts.iter().map(|entry| entry.0).chain(marked))?;
    let low = exp10((log10(covered.low()) + 1e-9).floor()).min(1e-5);
    let high = exp10((log10(covered.high()) - 1e-9).ceil()).max(1e-3);
    Some(Range::new(low.max(1e-9), high.min(1e6)))
}

fn describe(what: &str, counts: &[(f64, u64)]) -> String {
    let total = crate::format::count(counts.iter().map(|entry| entry.1).sum());
    match (counts.first(), counts.last()) {
        (Some(first), Some(last)) => {
            let show = crate::format::duration;
            format!("{what} of {total} samples from {} to {}.", show(first.0), show(last.0))
        }
        _ => format!("{what}: no samples."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_sample_is_lost_between_the_bars() {
        let counts: Vec<_> =
            (1..2000_u32).map(|i| (f64::from(i) * 1e-6, u64::from(i % 7))).collect();
        let total: u64 = counts.iter().map(|entry| entry.1).sum();
        let bars = bars(&sorted(&counts));
        assert_eq!(bars.iter().map(|bar| bar[2]).sum::<f64>(), total as f64);
        assert!(bars.windows(2).all(|pair| pair[0][1] <= pair[1][0] * (1.0 + 1e-12)));
    }

    #[test]
    fn the_tail_falls_from_all_to_the_last_one() {
        let points = tail(&sorted(&[(3e-4, 1), (1e-4, 98), (2e-4, 1)]));
        let shares: Vec<_> = points.iter().map(|point| point[1]).collect();
        assert_eq!(shares, [1.0, 0.02, 0.02, 0.01, 0.01]);
    }

    #[test]
    fn hostile_counts_survive() {
        let hostile = [(f64::NAN, 3), (-1.0, 2), (0.0, 1), (f64::INFINITY, 1)];
        for counts in [&hostile[..], &[]] {
            for figure in [
                latency_histogram("a", "b", counts, Vec::new()),
                latency_tail("a", "b", counts, Vec::new()),
            ] {
                assert!(figure.svg.contains("no data") && !figure.svg.contains("NaN"));
            }
        }
    }
}
