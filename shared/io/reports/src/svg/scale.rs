//! From values to figure units, and the ticks on the way.

use super::Range;
use crate::format::{self, exp10, log10};

/// How ticks are spaced and labelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ticks {
    /// Evenly, at 1, 2 or 5 times a power of ten; labelled with the number.
    Linear,
    /// At powers of ten; labelled as short times.
    LogDuration,
    /// At powers of ten; labelled as counts.
    LogCount,
    /// At powers of ten; labelled as shares in per cent.
    LogShare,
    /// At powers of ten; labelled with the number.
    Log,
}

/// A place on an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// The value.
    pub value: f64,
    /// Its label; empty for a small tick between labelled ones.
    pub label: String,
}

/// Maps values of a range to figure units.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    ticks: Ticks,
    values: Range,
    from: f64,
    to: f64,
}

impl Scale {
    /// `values.low()` goes to `from`, `values.high()` to `to`, in figure units. On a logarithmic
    /// scale values must be positive; a range that is not is taken as the decade above 1.
    #[must_use]
    pub fn new(ticks: Ticks, values: Range, from: f64, to: f64) -> Self {
        let values = match ticks {
            Ticks::Linear if values.span() > 0.0 => values,
            Ticks::Linear => values.at_least(1.0),
            _ if values.low() > 0.0 && values.span() > 0.0 => values,
            _ => Range::new(1.0, 10.0),
        };
        Self { ticks, values, from, to }
    }

    /// The values shown.
    #[must_use]
    pub fn values(&self) -> Range {
        self.values
    }

    /// Where `value` lies, in figure units; not finite where the value has no place.
    #[must_use]
    pub fn at(&self, value: f64) -> f64 {
        let share = match self.ticks {
            Ticks::Linear => (value - self.values.low()) / self.values.span(),
            _ => {
                let low = log10(self.values.low());
                (log10(value) - low) / (log10(self.values.high()) - low)
            }
        };
        self.from + share * (self.to - self.from)
    }

    /// About `count` ticks inside the range.
    #[must_use]
    pub fn ticks(&self, count: usize) -> Vec<Tick> {
        match self.ticks {
            Ticks::Linear => linear_ticks(self.values, count),
            kind => log_ticks(self.values, kind, count),
        }
    }
}

/// The step of 1, 2 or 5 times a power of ten that cuts `span` into at most `count` parts.
pub(crate) fn nice_step(span: f64, count: usize) -> f64 {
    let raw = span / count.max(1) as f64;
    if !raw.is_normal() || raw <= 0.0 {
        return 1.0;
    }
    let power = exp10(log10(raw).floor());
    let mantissa = raw / power;
    // The slack forgives the last bit of the logarithm at exact powers of ten.
    let nice = [1.0, 2.0, 5.0, 10.0].into_iter().find(|nice| mantissa <= nice + 1e-9);
    nice.unwrap_or(10.0) * power
}

fn linear_ticks(values: Range, count: usize) -> Vec<Tick> {
    let step = nice_step(values.span(), count);
    let decimals = (-(log10(step) + 1e-9).floor()).clamp(0.0, 12.0) as usize;
    let slack = 1e-9 * values.span();
    let first = ((values.low() - slack) / step).ceil();
    (0..=2 * count.max(1))
        .map(|index| (first + index as f64) * step)
        .take_while(|value| *value <= values.high() + slack)
        .map(|value| Tick { value, label: format::fixed(value, decimals) })
        .collect()
}

fn log_ticks(values: Range, kind: Ticks, count: usize) -> Vec<Tick> {
    let first = (log10(values.low()) - 1e-9).floor();
    let decades = (log10(values.high()) + 1e-9).ceil() - first;
    let stride = (decades / count.max(1) as f64).ceil().max(1.0);
    // Where hardly a decade is seen, its parts are named, too.
    let has_few = decades <= 2.0 && log10(values.high() / values.low()) < 1.8;
    let mut ticks = Vec::new();
    for decade in 0..=decades.min(400.0) as u32 {
        let power = exp10(first + f64::from(decade));
        let is_labelled = f64::from(decade) % stride == 0.0;
        push_log_tick(&mut ticks, values, power, is_labelled.then_some(kind));
        for factor in 2..10_u32 {
            let is_labelled = has_few && matches!(factor, 2 | 5) && kind == Ticks::Log;
            let label = is_labelled.then_some(kind);
            push_log_tick(&mut ticks, values, power * f64::from(factor), label);
        }
    }
    ticks
}

fn push_log_tick(ticks: &mut Vec<Tick>, values: Range, value: f64, kind: Option<Ticks>) {
    let slack = 1.0 + 1e-9;
    if value * slack < values.low() || value > values.high() * slack {
        return;
    }
    let label = kind.map_or_else(String::new, |kind| log_label(value, kind));
    ticks.push(Tick { value, label });
}

fn log_label(value: f64, kind: Ticks) -> String {
    match kind {
        Ticks::LogDuration => plain_duration(value),
        Ticks::LogShare => format::with_unit(&plain(value * 100.0), "%"),
        Ticks::Log => plain(value),
        Ticks::LogCount | Ticks::Linear => format::count(value.round() as u64),
    }
}

/// A power of ten as people say it: 10 us, 1 ms.
fn plain_duration(seconds: f64) -> String {
    let units = [(1e-6, "us", 0.999e-3), (1e-3, "ms", 0.999), (1.0, "s", f64::INFINITY)];
    let found = units.iter().find(|(_, _, limit)| seconds < *limit);
    let (unit, name, _) = found.unwrap_or(&units[2]);
    format::with_unit(&plain(seconds / unit), name)
}

fn plain(value: f64) -> String {
    let decimals = (-(log10(value) + 1e-9).floor()).clamp(0.0, 9.0) as usize;
    format::fixed(value, decimals)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn labels(ticks: &[Tick]) -> Vec<&str> {
        ticks.iter().map(|tick| tick.label.as_str()).filter(|label| !label.is_empty()).collect()
    }

    #[test]
    fn linear_ticks_are_round() {
        let scale = Scale::new(Ticks::Linear, Range::new(-2.0, 2.5), 0.0, 1.0);
        assert_eq!(
            labels(&scale.ticks(5)),
            ["\u{2212}2", "\u{2212}1", "0", "1", "2"],
            "whole numbers need no decimals"
        );
        let fine = Scale::new(Ticks::Linear, Range::new(0.0, 0.5), 0.0, 1.0);
        assert_eq!(labels(&fine.ticks(5)), ["0.0", "0.1", "0.2", "0.3", "0.4", "0.5"]);
    }

    #[test]
    fn log_ticks_name_the_decades() {
        let scale = Scale::new(Ticks::LogDuration, Range::new(1e-5, 1e-1), 0.0, 100.0);
        assert_eq!(
            labels(&scale.ticks(8)),
            ["10\u{202f}us", "100\u{202f}us", "1\u{202f}ms", "10\u{202f}ms", "100\u{202f}ms"]
        );
        assert!((scale.at(1e-3) - 50.0).abs() < 1e-9);
        let share = Scale::new(Ticks::LogShare, Range::new(1e-4, 1.0), 0.0, 1.0);
        assert_eq!(
            labels(&share.ticks(8)),
            ["0.01\u{202f}%", "0.1\u{202f}%", "1\u{202f}%", "10\u{202f}%", "100\u{202f}%"]
        );
        let number = Scale::new(Ticks::Log, Range::new(0.01, 100.0), 0.0, 1.0);
        assert_eq!(labels(&number.ticks(8)), ["0.01", "0.1", "1", "10", "100"]);
        let short = Scale::new(Ticks::Log, Range::new(0.25, 8.0), 0.0, 1.0);
        assert_eq!(labels(&short.ticks(8)), ["0.5", "1", "2", "5"]);
    }

    #[test]
    fn a_range_of_one_value_still_has_a_scale() {
        let scale = Scale::new(Ticks::Linear, Range::new(3.0, 3.0), 0.0, 100.0);
        assert_eq!(scale.at(3.0), 50.0);
        let log = Scale::new(Ticks::LogCount, Range::new(0.0, 0.0), 0.0, 1.0);
        assert!(log.at(5.0).is_finite() && !log.at(0.0).is_finite());
    }

    proptest! {
        #[test]
        fn ticks_are_inside_evenly_spaced_and_few(
            low in -1e6_f64..1e6,
            exponent in -6.0_f64..6.0,
            count in 2_usize..12,
        ) {
            let span = exp10(exponent);
            let values = Range::new(low, low + span);
            let ticks = linear_ticks(values, count);
            let step = nice_step(values.span(), count);
            prop_assert!(!ticks.is_empty() || step > 0.5 * span);
            prop_assert!(ticks.len() <= count + 1, "{} ticks", ticks.len());
            for tick in &ticks {
                prop_assert!(values.padded(1e-6).holds(tick.value));
            }
            for pair in ticks.windows(2) {
                prop_assert!((pair[1].value - pair[0].value - step).abs() < 1e-6 * step + 1e-9);
                prop_assert_ne!(&pair[0].label, &pair[1].label);
            }
            let mantissa = step / exp10(log10(step * (1.0 + 1e-9)).floor());
            prop_assert!([1.0, 2.0, 5.0].iter().any(|nice| (mantissa - nice).abs() < 1e-6));
        }
    }
}
