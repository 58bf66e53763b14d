//! Types, units and ranges that a key may be declared with.

use core::fmt;
use core::ops::Range as Span;
use std::borrow::Cow;
use std::collections::BTreeMap;

use toml::Spanned;
use toml::de::{DeArray, DeInteger, DeValue};

use super::Value;
use crate::problem::Cause;

/// An interval of numbers; each end is part of it or not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    low: Option<(f64, bool)>,
    high: Option<(f64, bool)>,
}

impl Range {
    /// Every finite number.
    pub const ANY: Self = Self { low: None, high: None };

    /// `low` and more.
    #[must_use]
    pub const fn from(low: f64) -> Self {
        Self { low: Some((low, true)), high: None }
    }

    /// More than `low`.
    #[must_use]
    pub const fn above(low: f64) -> Self {
        Self { low: Some((low, false)), high: None }
    }

    /// The same, and at most `high`.
    #[must_use]
    pub const fn to(self, high: f64) -> Self {
        Self { high: Some((high, true)), ..self }
    }

    /// The same, and less than `high`.
    #[must_use]
    pub const fn below(self, high: f64) -> Self {
        Self { high: Some((high, false)), ..self }
    }

    /// Whether a number is finite and in the interval.
    #[must_use]
    pub fn contains(&self, number: f64) -> bool {
        let above = self.low.is_none_or(|(low, closed)| number > low || closed && number == low);
        let below =
            self.high.is_none_or(|(high, closed)| number < high || closed && number == high);
        number.is_finite() && above && below
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let low = |closed| if closed { "at least" } else { "above" };
        let high = |closed| if closed { "at most" } else { "below" };
        match (self.low, self.high) {
            (None, None) => f.write_str("any finite number"),
            (Some((from, true)), Some((to, true))) => write!(f, "{from} to {to}"),
            (Some((from, closed)), None) => write!(f, "{} {from}", low(closed)),
            (None, Some((to, closed))) => write!(f, "{} {to}", high(closed)),
            (Some((from, from_closed)), Some((to, to_closed))) => {
                write!(f, "{} {from}, {} {to}", low(from_closed), high(to_closed))
            }
        }
    }
}

/// What a key holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A number in a unit.
    Number {
        /// The unit; empty for a pure number.
        unit: &'static str,
        /// What is allowed.
        range: Range,
    },
    /// A whole number.
    Integer {
        /// The unit; empty for a pure number.
        unit: &'static str,
        /// Least.
        low: i64,
        /// Greatest.
        high: i64,
    },
    /// `true` or `false`.
    Flag,
    /// Text that is not empty.
    Text,
    /// One of these names.
    Choice(&'static [&'static str]),
    /// A list.
    List {
        /// What each element holds.
        of: &'static Kind,
        /// Fewest elements.
        least: usize,
        /// Most elements.
        most: usize,
    },
    /// A table whose keys are free.
    Free,
}

/// Something wrong in a value: where, and what.
pub(crate) struct Fault {
    /// Index within the key's value, like `[2][0]`; empty for the value itself.
    pub(crate) index: String,
    /// Bytes of the file.
    pub(crate) span: Span<usize>,
    /// What.
    pub(crate) cause: Cause,
    /// What is allowed there.
    pub(crate) allowed: String,
}

impl Kind {
    /// A pure number.
    #[must_use]
    pub const fn number(range: Range) -> Self {
        Self::Number { unit: "", range }
    }

    /// A length \[m\].
    #[must_use]
    pub const fn metres(range: Range) -> Self {
        Self::Number { unit: "m", range }
    }

    /// A time \[s\].
    #[must_use]
    pub const fn seconds(range: Range) -> Self {
        Self::Number { unit: "s", range }
    }

    /// An angle \[rad\].
    #[must_use]
    pub const fn radians(range: Range) -> Self {
        Self::Number { unit: "rad", range }
    }

    /// An angle in degrees; the key says so in its name.
    #[must_use]
    pub const fn degrees(range: Range) -> Self {
        Self::Number { unit: "degrees", range }
    }

    /// A number in another unit.
    #[must_use]
    pub const fn unit(unit: &'static str, range: Range) -> Self {
        Self::Number { unit, range }
    }

    /// The word for the type.
    #[must_use]
    pub const fn type_name(&self) -> &'static str {
        match self {
            Self::Number { .. } => "number",
            Self::Integer { .. } => "integer",
            Self::Flag => "boolean",
            Self::Text | Self::Choice(_) => "string",
            Self::List { .. } => "array",
            Self::Free => "table",
        }
    }

    /// The unit, through lists; empty for what has none.
    #[must_use]
    pub const fn unit_name(&self) -> &'static str {
        match self {
            Self::Number { unit, .. } | Self::Integer { unit, .. } => unit,
            Self::List { of, .. } => of.unit_name(),
            _ => "",
        }
    }

    /// Reads a value of this kind; what is wrong with it goes to `faults`.
    pub(crate) fn read(
        &self,
        value: &Spanned<DeValue<'_>>,
        index: &str,
        faults: &mut Vec<Fault>,
    ) -> Option<Value> {
        let cause = match (self, value.get_ref()) {
            (Self::List { of, .. }, DeValue::Array(items)) if self.fits(items) => {
                return read_list(of, items, index, faults);
            }
            (_, found) => match self.read_plain(found) {
                Ok(value) => return Some(value),
                Err(cause) => cause,
            },
        };
        let allowed = self.to_string();
        faults.push(Fault { index: index.to_owned(), span: value.span(), cause, allowed });
        None
    }

    fn fits(&self, items: &DeArray<'_>) -> bool {
        matches!(self, Self::List { least, most, .. } if (*least..=*most).contains(&items.len()))
    }

    fn read_plain(&self, found: &DeValue<'_>) -> Result<Value, Cause> {
        match (self, found) {
            (Self::Number { range, .. }, DeValue::Integer(_) | DeValue::Float(_)) => {
                let number = number(found).filter(|number| range.contains(*number));
                number.map(Value::Number).ok_or(Cause::OutOfRange)
            }
            (Self::Integer { low, high, .. }, DeValue::Integer(digits)) => {
                let number = integer(digits).filter(|number| (*low..=*high).contains(number));
                number.map(Value::Integer).ok_or(Cause::OutOfRange)
            }
            (Self::Flag, DeValue::Boolean(flag)) => Ok(Value::Flag(*flag)),
            (Self::Text, DeValue::String(text)) if !text.trim().is_empty() => {
                Ok(Value::Text(text.to_string()))
            }
            (Self::Choice(names), DeValue::String(text)) if names.contains(&text.as_ref()) => {
                Ok(Value::Text(text.to_string()))
            }
            (Self::Text | Self::Choice(_), DeValue::String(_)) => Err(Cause::NotAllowed),
            (Self::List { .. }, DeValue::Array(items)) => Err(Cause::Elements(items.len())),
            (Self::Free, DeValue::Table(_)) => Ok(free(found)),
            _ => Err(Cause::WrongType { found: found.type_str() }),
        }
    }
}

fn read_list(
    of: &Kind,
    items: &DeArray<'_>,
    index: &str,
    faults: &mut Vec<Fault>,
) -> Option<Value> {
    let values: Vec<_> = items
        .iter()
        .enumerate()
        .map(|(position, item)| of.read(item, &format!("{index}[{position}]"), faults))
        .collect();
    values.into_iter().collect::<Option<Vec<_>>>().map(Value::List)
}

fn integer(digits: &DeInteger<'_>) -> Option<i64> {
    i64::from_str_radix(digits.as_str(), digits.radix()).ok()
}

#[allow(clippy::cast_precision_loss)] // A length of 2^53 m is out of every range.
pub(crate) fn number(found: &DeValue<'_>) -> Option<f64> {
    match found {
        DeValue::Integer(digits) => integer(digits).map(|number| number as f64),
        DeValue::Float(digits) => digits.as_str().parse().ok(),
        _ => None,
    }
}

/// Any value, kept as it is; dates become text, numbers too large become text as well.
fn free(found: &DeValue<'_>) -> Value {
    match found {
        DeValue::String(text) => Value::Text(text.to_string()),
        DeValue::Integer(digits) => {
            integer(digits).map_or_else(|| Value::Text(digits.to_string()), Value::Integer)
        }
        DeValue::Float(digits) => number(found)
            .filter(|number| number.is_finite())
            .map_or_else(|| Value::Text(digits.to_string()), Value::Number),
        DeValue::Boolean(flag) => Value::Flag(*flag),
        DeValue::Datetime(date) => Value::Text(date.to_string()),
        DeValue::Array(items) => {
            Value::List(items.iter().map(|item| free(item.get_ref())).collect())
        }
        DeValue::Table(table) => {
            let entry = |(key, value): (&Spanned<Cow<'_, str>>, &Spanned<DeValue<'_>>)| {
                (key.get_ref().to_string(), free(value.get_ref()))
            };
            Value::Table(table.iter().map(entry).collect::<BTreeMap<_, _>>())
        }
    }
}

impl fmt::Display for Kind {
    /// What is allowed, for people.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number { unit: "", range } => write!(f, "a number, {range}"),
            Self::Number { unit, range } => write!(f, "a number in {unit}, {range}"),
            Self::Integer { unit: "", low, high } => write!(f, "an integer, {low} to {high}"),
            Self::Integer { unit, low, high } => {
                write!(f, "an integer in {unit}, {low} to {high}")
            }
            Self::Flag => f.write_str("true or false"),
            Self::Text => f.write_str("a string that is not empty"),
            Self::Choice(names) => {
                let names: Vec<_> = names.iter().map(|name| format!("\"{name}\"")).collect();
                write!(f, "one of {}", names.join(", "))
            }
            Self::List { of, least, most } if least == most => {
                write!(f, "an array of {least}, each {of}")
            }
            Self::List { of, least, most: usize::MAX } => {
                write!(f, "an array of {least} or more, each {of}")
            }
            Self::List { of, least, most } => {
                write!(f, "an array of {least} to {most}, each {of}")
            }
            Self::Free => f.write_str("a table with keys of your own"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_belong_to_a_range_as_declared() {
        let open = Range::above(0.0).below(1.0);
        assert!(open.contains(0.5) && !open.contains(0.0) && !open.contains(1.0));
        let closed = Range::from(0.0).to(1.0);
        assert!(closed.contains(0.0) && closed.contains(1.0) && !closed.contains(1.0 + 1e-12));
        assert!(!Range::ANY.contains(f64::NAN) && !Range::ANY.contains(f64::INFINITY));
    }

    #[test]
    fn ranges_read_as_prose() {
        assert_eq!(Range::above(0.0).to(2.0).to_string(), "above 0, at most 2");
        assert_eq!(Range::from(0.0).to(2.0).to_string(), "0 to 2");
        assert_eq!(Range::from(0.5).to_string(), "at least 0.5");
    }
}
