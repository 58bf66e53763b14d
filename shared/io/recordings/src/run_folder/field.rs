//! One field of a CSV file.

use core::fmt;

/// The whole numbers that a double holds exactly: beyond them a fraction may have been lost.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// What a column may hold besides nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Allowed {
    /// A whole number.
    Count,
    /// A finite number in a range.
    Number {
        /// Smallest.
        low: f64,
        /// Largest.
        high: f64,
        /// Its unit.
        unit: &'static str,
    },
}

impl Allowed {
    /// A number of at most `bound` in size.
    #[must_use]
    pub const fn within(bound: f64, unit: &'static str) -> Self {
        Self::Number { low: -bound, high: bound, unit }
    }
}

impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count => f.write_str("a whole number of 64 bits"),
            Self::Number { low, high, unit } => {
                write!(f, "a number from {low} to {high} {unit}")
            }
        }
    }
}

/// A finite number in the range of `allowed`; none where the field is anything else.
pub(crate) fn number(field: &str, allowed: Allowed) -> Option<f64> {
    let Allowed::Number { low, high, .. } = allowed else { return None };
    // What is not a number is in no range, and neither is an infinite one.
    field.parse().ok().filter(|value| (low..=high).contains(value))
}

/// A whole number; tools that know doubles alone may write it as `123.0` or `1.23e2`.
#[allow(clippy::cast_possible_truncation)] // Whole and below 2^53 when cast.
pub(crate) fn count(field: &str) -> Option<i64> {
    field.parse().ok().or_else(|| {
        let value: f64 = field.parse().ok()?;
        (value.abs() <= EXACT && value.trunc() == value).then_some(value as i64)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_whole_numbers_however_written() {
        assert_eq!(count("-2147359480"), Some(-2_147_359_480));
        assert_eq!(count("9223372036854775807"), Some(i64::MAX));
        assert_eq!(count("123.0"), Some(123));
        assert_eq!(count("1.5e3"), Some(1500));
        for field in ["", " 1", "1.5", "nan", "inf", "9223372036854775808", "1e300", "0x10"] {
            assert_eq!(count(field), None, "{field}");
        }
    }

    #[test]
    fn numbers_are_finite_and_in_range() {
        let allowed = Allowed::within(10.0, "m");
        assert_eq!(number("-10", allowed), Some(-10.0));
        assert_eq!(number("1e-3", allowed), Some(0.001));
        for field in ["", " 1", "1,5", "nan", "-inf", "10.1", "1e999", "one"] {
            assert_eq!(number(field, allowed), None, "{field}");
        }
    }
}
