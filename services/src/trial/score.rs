//! All cases together: shares with intervals, calibration, and the figures that a trial holds itself against.

use super::judge::Row;
use super::rivals::RIVALS;
use super::sitting::AT_ONCE;
use crate::figures::Figure;

/// From this size d on an effect is to be found.
pub const LARGE: f64 = 10.0;
/// Ends of the classes of size.
pub const SIZES: [f64; 5] = [0.0, 5.0, LARGE, 30.0, f64::INFINITY];
/// Ends of the classes of stated probability.
const BINS: [f64; 8] = [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.000_000_1];
/// Half a 95 % interval in standard deviations.
const Z: f64 = 1.96;

/// So many of so many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Share {
    /// Right ones.
    pub right: usize,
    /// All.
    pub of: usize,
}

impl Share {
    /// Counts.
    pub fn count(hits: impl IntoIterator<Item = bool>) -> Self {
        hits.into_iter().fold(Self::default(), |share, hit| Self {
            right: share.right + usize::from(hit),
            of: share.of + 1,
        })
    }

    /// The share; not a number of none.
    #[must_use]
    pub fn value(&self) -> f64 {
        real(self.right) / real(self.of)
    }

    /// Wilson's 95 % interval; all where there is none.
    #[must_use]
    pub fn interval(&self) -> (f64, f64) {
        if self.of == 0 {
            return (0.0, 1.0);
        }
        let (n, p) = (real(self.of), self.value());
        let d = 1.0 + Z * Z / n;
        let middle = (p + Z * Z / 2.0 / n) / d;
        let half = Z * (p * (1.0 - p) / n + Z * Z / 4.0 / n / n).sqrt() / d;
        ((middle - half).max(0.0), (middle + half).min(1.0))
    }
}

#[allow(clippy::cast_precision_loss)] // Counts of cases.
fn real(count: usize) -> f64 {
    count as f64
}

/// A class of stated probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// From and to.
    pub ends: (f64, f64),
    /// Mean of what was stated.
    pub stated: f64,
    /// How often it was right.
    pub right: Share,
}

/// Everything that is printed.
#[derive(Clone, Debug)]
pub struct Score {
    /// Every case.
    pub rows: Vec<Row>,
}

impl Score {
    /// Rows of these kinds, of any size.
    pub fn of<'a>(&'a self, kinds: &'a [&'a str]) -> impl Iterator<Item = &'a Row> {
        self.rows.iter().filter(move |row| kinds.contains(&row.label.kind.as_str()))
    }

    /// The same, of those that are large enough to be found.
    pub fn large<'a>(&'a self, kinds: &'a [&'a str]) -> impl Iterator<Item = &'a Row> {
        self.of(kinds).filter(|row| row.label.size.is_some_and(|size| size >= LARGE))
    }

    /// False alarms on cases in good order.
    #[must_use]
    pub fn false_alarms(&self) -> Share {
        Share::count(self.of(&["null"]).map(|row| !row.exact))
    }

    /// Unknowns that were said to be unknown.
    #[must_use]
    pub fn unknown_flagged(&self) -> Share {
        Share::count(self.of(&["unknown"]).map(|row| row.exact))
    }

    /// Others that were.
    #[must_use]
    pub fn false_unknown(&self) -> Share {
        let unknown = |row: &Row| row.verdict.as_deref() == Some("unknown");
        Share::count(self.of(&["null", "single", "pair"]).map(unknown))
    }

    /// 90 % sets that hold the truth.
    #[must_use]
    pub fn coverage(&self) -> Share {
        Share::count(self.of(&["single", "pair"]).map(|row| row.in_set))
    }

    /// Mean size of those sets at large effects.
    #[must_use]
    pub fn mean_set(&self) -> f64 {
        mean(
            self.large(&["single", "pair"])
                .filter(|row| row.verdict.is_some())
                .map(|row| real(row.set_size)),
        )
    }

    /// Classes of stated probability that have cases.
    #[must_use]
    pub fn reliability(&self) -> Vec<Bin> {
        let stated: Vec<(f64, bool)> =
            self.rows.iter().filter_map(|row| Some((row.stated?, row.right))).collect();
        let bin = |ends: &[f64]| {
            let within: Vec<_> =
                stated.iter().filter(|(p, _)| (ends[0]..ends[1]).contains(p)).collect();
            (!within.is_empty()).then(|| Bin {
                ends: (ends[0], ends[1].min(1.0)),
                stated: mean(within.iter().map(|known| known.0)),
                right: Share::count(within.iter().map(|known| known.1)),
            })
        };
        BINS.windows(2).filter_map(bin).collect()
    }

    /// Expected calibration error; not a number where nothing was named.
    #[must_use]
    pub fn ece(&self) -> f64 {
        let bins = self.reliability();
        let all: usize = bins.iter().map(|bin| bin.right.of).sum();
        let off = |bin: &Bin| real(bin.right.of) * (bin.stated - bin.right.value()).abs();
        bins.iter().map(off).sum::<f64>() / real(all)
    }

    /// Median error of parameters at large effects.
    #[must_use]
    pub fn parameter_error(&self) -> f64 {
        let rows = self.large(&["single", "pair"]).filter(|row| row.right || row.exact);
        median(rows.flat_map(|row| row.errors.iter().map(|error| error.1)))
    }

    /// Parameters within their 90 % interval.
    #[must_use]
    pub fn intervals(&self) -> Share {
        Share::count(self.of(&["single", "pair"]).flat_map(|row| row.covered.iter().copied()))
    }

    /// Median share of the explainable gap removed, at large effects.
    #[must_use]
    pub fn removed(&self) -> f64 {
        median(self.large(&["single", "pair"]).filter_map(|row| row.removed))
    }

    /// Median of what the truth would have removed more, at large effects.
    #[must_use]
    pub fn regret(&self) -> f64 {
        let rows = self.large(&["single", "pair"]).filter_map(|row| row.removed);
        median(rows.map(|removed| (1.0 - removed).max(0.0)))
    }

    /// How often each rival is right about single effects, and chance.
    #[must_use]
    pub fn rivals(&self) -> Vec<(&'static str, Share)> {
        let rival = |i: usize| {
            let rows = self.of(&["single"]);
            Share::count(rows.filter_map(|row| row.rivals.get(i).copied()))
        };
        RIVALS.iter().enumerate().map(|(i, name)| (*name, rival(i))).collect()
    }

    /// Shares by a word of each row, in the order of the words.
    pub fn by(&self, kinds: &[&str], word: impl Fn(&Row) -> String) -> Vec<(String, Share, Share)> {
        let mut words: Vec<String> = self.of(kinds).map(&word).collect();
        words.sort();
        words.dedup();
        let shares = |name: String| {
            let rows: Vec<&Row> = self.of(kinds).filter(|row| word(row) == name).collect();
            let link = Share::count(rows.iter().map(|row| row.link));
            (name, Share::count(rows.iter().map(|row| row.exact)), link)
        };
        words.into_iter().map(shares).collect()
    }

    /// Time per case on all cores \[s\]: so many diagnoses share them, and each has its part of the time that it took.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        mean(self.rows.iter().filter_map(|row| row.seconds)) / real(AT_ONCE)
    }

    /// What the trial holds itself against.
    #[must_use]
    pub fn figures(&self) -> Vec<Figure> {
        let least = |name: &str, share: Share, limit: f64| {
            let (low, high) = share.interval();
            Figure::at_least(name, share.value(), limit).within(low, high)
        };
        let most = |name: &str, share: Share, limit: f64| {
            let (low, high) = share.interval();
            Figure::at_most(name, share.value(), limit).within(low, high)
        };
        let both = ["single", "pair"];
        let singles = || self.large(&["single"]);
        vec![
            least(
                "right link of singles, d >= 10",
                Share::count(singles().map(|row| row.link)),
                0.97,
            ),
            least(
                "right effect of singles, d >= 10",
                Share::count(singles().map(|row| row.exact)),
                0.95,
            ),
            least(
                "right link moved before any fit, d >= 10",
                Share::count(singles().map(|row| row.moved)),
                0.95,
            ),
            least(
                "both of a pair, d >= 10",
                Share::count(self.large(&["pair"]).map(|row| row.exact)),
                0.85,
            ),
            Figure::at_most("median parameter error, d >= 10", self.parameter_error(), 0.05),
            Figure::at_least(
                "mean probability on the truth, d >= 10",
                mean(self.large(&both).map(|row| row.on_truth)),
                0.85,
            ),
            Figure::at_least("median gap removed, d >= 10", self.removed(), 0.95),
            Figure::at_most("median regret, d >= 10", self.regret(), 0.05),
            most("false alarms on cases in good order", self.false_alarms(), 0.016),
            least("unknowns flagged", self.unknown_flagged(), 0.85),
            most("false unknowns", self.false_unknown(), 0.05),
            least("90 % sets that hold the truth", self.coverage(), 0.87),
            most("90 % sets that hold the truth, no wider", self.coverage(), 0.95),
            Figure::at_most("mean size of a 90 % set, d >= 10", self.mean_set(), 1.5),
            Figure::at_most("calibration error", self.ece(), 0.05),
            Figure::at_most("seconds per case", self.seconds(), 4.0),
        ]
    }
}

/// The mean; not a number of none.
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

/// The median; not a number of none.
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    match values.len() {
        0 => f64::NAN,
        odd if odd % 2 == 1 => values[half],
        _ => 0.5 * (values[half - 1] + values[half]),
    }
}

/// The class of size of a row, as a word that sorts by size.
#[must_use]
pub fn size_class(row: &Row) -> String {
    let Some(size) = row.label.size else { return "no d".to_owned() };
    let above = SIZES.windows(2).find(|ends| (ends[0]..ends[1]).contains(&size));
    above.map_or_else(
        || "no d".to_owned(),
        |ends| {
            if ends[1].is_infinite() {
                format!("{:>2.0} and more", ends[0])
            } else {
                format!("{:>2.0} to {:.0}", ends[0], ends[1])
            }
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilsons_interval_is_that_of_the_book() {
        // Wilson (1927) by hand for 9 of 10: 0.596 to 0.982.
        let (low, high) = Share { right: 9, of: 10 }.interval();
        assert!((low - 0.5958).abs() < 1e-3 && (high - 0.9821).abs() < 1e-3, "{low} {high}");
        assert_eq!(Share { right: 0, of: 0 }.interval(), (0.0, 1.0));
        assert!(Share { right: 0, of: 20 }.interval().1 > 0.1);
    }

    #[test]
    fn medians_and_means_of_nothing_are_no_numbers() {
        assert!(median([].into_iter()).is_nan() && mean([].into_iter()).is_nan());
        assert_eq!(median([3.0, 1.0, 2.0, 10.0].into_iter()), 2.5);
    }

    #[test]
    fn calibration_error_is_the_mean_distance_of_the_classes() {
        let row = |stated: f64, right: bool| Row { stated: Some(stated), right, ..Row::default() };
        let rows = vec![row(0.95, true), row(0.97, false), row(0.6, true), row(0.65, true)];
        let score = Score { rows };
        let expected = 0.5 * (0.96 - 0.5) + 0.5 * (1.0 - 0.625);
        assert!((score.ece() - expected).abs() < 1e-12, "{}", score.ece());
    }
}
