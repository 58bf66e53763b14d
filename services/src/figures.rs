//! Figures that a verb holds itself against.

use serde_json::{Value, json};

/// A figure with its limit.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What it is, with unit.
    pub name: String,
    /// What was measured; not a number where it could not be.
    pub value: f64,
    /// Interval of the measurement, where there is one.
    pub interval: Option<(f64, f64)>,
    /// What is allowed.
    pub limit: Limit,
}

/// What is allowed of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limit {
    /// No more than this.
    AtMost(f64),
    /// No less than this.
    AtLeast(f64),
}

impl Figure {
    /// A figure that may not be greater than `limit`.
    #[must_use]
    pub fn at_most(name: &str, value: f64, limit: f64) -> Self {
        Self { name: name.to_owned(), value, interval: None, limit: Limit::AtMost(limit) }
    }

    /// A figure that may not be less than `limit`.
    #[must_use]
    pub fn at_least(name: &str, value: f64, limit: f64) -> Self {
        Self { name: name.to_owned(), value, interval: None, limit: Limit::AtLeast(limit) }
    }

    /// The same with the interval of its measurement.
    #[must_use]
    pub fn within(self, low: f64, high: f64) -> Self {
        Self { interval: Some((low, high)), ..self }
    }

    /// Whether it is as allowed; a figure that could not be measured is not.
    #[must_use]
    pub fn passed(&self) -> bool {
        match self.limit {
            Limit::AtMost(limit) => self.value <= limit,
            Limit::AtLeast(limit) => self.value >= limit,
        }
    }

    /// As every verb prints it with `--json`.
    #[must_use]
    pub fn as_json(&self) -> Value {
        let (low, high) = self.interval.unzip();
        let limit = match self.limit {
            Limit::AtMost(limit) | Limit::AtLeast(limit) => limit,
        };
        json!({
            "name": self.name, "value": self.value, "low": low, "high": high, "limit": limit, "passed": self.passed(),
        })
    }
}

impl core::fmt::Display for Figure {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let mark = if self.passed() { "ok    " } else { "MISSED" };
        write!(f, "{mark} {}: {:.4}", self.name, self.value)?;
        if let Some((low, high)) = self.interval {
            write!(f, " ({low:.4} to {high:.4})")?;
        }
        match self.limit {
            Limit::AtMost(limit) => write!(f, ", at most {limit:.4}"),
            Limit::AtLeast(limit) => write!(f, ", at least {limit:.4}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_measured_has_not_passed() {
        assert!(Figure::at_most("a", 1.0, 1.0).passed());
        assert!(!Figure::at_most("a", f64::NAN, 1.0).passed());
        assert!(!Figure::at_least("a", f64::NAN, 1.0).passed());
    }
}
