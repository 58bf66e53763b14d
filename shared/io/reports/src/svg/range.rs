//! Intervals of the number line.

/// From `low` to `high`, both finite, `low <= high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    low: f64,
    high: f64,
}

impl Range {
    /// From the lesser of two numbers to the greater; 0 to 1 where one is not finite.
    #[must_use]
    pub fn new(a: f64, b: f64) -> Self {
        if a.is_finite() && b.is_finite() && (b - a).is_finite() {
            Self { low: a.min(b), high: a.max(b) }
        } else {
            Self { low: 0.0, high: 1.0 }
        }
    }

    /// The least range that holds every finite value; none where there is none.
    #[must_use]
    pub fn covering(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut finite = values.into_iter().filter(|value| value.is_finite());
        let first = finite.next()?;
        let (low, high) =
            finite.fold((first, first), |(low, high), value| (low.min(value), high.max(value)));
        Some(Self::new(low, high))
    }

    /// Lower end.
    #[must_use]
    pub const fn low(&self) -> f64 {
        self.low
    }

    /// Upper end.
    #[must_use]
    pub const fn high(&self) -> f64 {
        self.high
    }

    /// Length.
    #[must_use]
    pub fn span(&self) -> f64 {
        self.high - self.low
    }

    /// Middle.
    #[must_use]
    pub fn middle(&self) -> f64 {
        self.low + 0.5 * self.span()
    }

    /// Whether the value lies inside or on an end.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// Longer by `share` of its length at each end.
    #[must_use]
    pub fn padded(&self, share: f64) -> Self {
        let pad = share * self.span();
        Self::new(self.low - pad, self.high + pad)
    }

    /// Made longer about its middle to at least `span`.
    #[must_use]
    pub fn at_least(&self, span: f64) -> Self {
        if self.span() >= span {
            return *self;
        }
        Self::new(self.middle() - 0.5 * span, self.middle() + 0.5 * span)
    }

    /// The least range that holds both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self::new(self.low.min(other.low), self.high.max(other.high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_finite_is_passed_over() {
        let range = Range::covering([f64::NAN, 2.0, f64::INFINITY, -1.0]).unwrap();
        assert_eq!(range, Range::new(-1.0, 2.0));
        assert_eq!(Range::covering([f64::NAN]), None);
        assert_eq!(Range::new(f64::MIN, f64::MAX), Range::new(0.0, 1.0));
    }

    #[test]
    fn a_point_becomes_a_range() {
        let range = Range::new(3.0, 3.0).at_least(2.0);
        assert_eq!(range, Range::new(2.0, 4.0));
        assert_eq!(range.padded(0.5), Range::new(1.0, 5.0));
    }
}
