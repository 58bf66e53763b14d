//! Figures and what is accepted of them.

/// What is accepted of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Accept {
    /// No more than this.
    AtMost(f64),
    /// No less than this.
    AtLeast(f64),
    /// From the first to the second.
    Within(f64, f64),
    /// Anything: it is shown beside the others.
    Shown,
}

impl Accept {
    /// Whether `value` is accepted; what is not a number never is, unless it is only shown.
    #[must_use]
    pub fn holds(self, value: f64) -> bool {
        match self {
            Self::AtMost(limit) => value <= limit,
            Self::AtLeast(limit) => value >= limit,
            Self::Within(low, high) => (low..=high).contains(&value),
            Self::Shown => true,
        }
    }

    /// Whether something between `low` and `high` is accepted.
    fn meets(self, (low, high): (f64, f64)) -> bool {
        match self {
            Self::AtMost(limit) => low <= limit,
            Self::AtLeast(limit) => high >= limit,
            Self::Within(from, to) => low <= to && high >= from,
            Self::Shown => true,
        }
    }
}

/// What becomes of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is as accepted.
    Reached,
    /// It is not, but its interval reaches into what is accepted, and there were fewer trials than are asked for.
    Open,
    /// It is not.
    Missed,
}

/// A figure of one of the nine rows of acceptance (digest of the paper, section 6).
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// The row, 1 to 9.
    pub row: u8,
    /// What it is.
    pub name: String,
    /// Its unit; empty for a ratio.
    pub unit: &'static str,
    /// What the paper prints in its place; empty for nothing.
    pub paper: &'static str,
    /// What came out.
    pub ours: f64,
    /// 95 % interval of it over the trials; both ends are the figure itself where chance plays no part.
    pub interval: (f64, f64),
    /// What is accepted.
    pub accept: Accept,
}

impl Figure {
    /// A figure without an interval, for which the paper prints nothing.
    #[must_use]
    pub fn new(
        row: u8,
        name: impl Into<String>,
        unit: &'static str,
        ours: f64,
        accept: Accept,
    ) -> Self {
        let (name, interval) = (name.into(), (ours, ours));
        Self { row, name, unit, paper: "", ours, interval, accept }
    }

    /// The same with the interval of its measurement.
    #[must_use]
    pub fn between(self, interval: (f64, f64)) -> Self {
        Self { interval, ..self }
    }

    /// The same beside what the paper prints.
    #[must_use]
    pub fn beside(self, paper: &'static str) -> Self {
        Self { paper, ..self }
    }

    /// Whether it is as accepted.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.accept.holds(self.ours)
    }

    /// Whether anything is asked of it.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.accept != Accept::Shown
    }

    /// What becomes of it; `full` where there were as many trials as are asked for.
    #[must_use]
    pub fn verdict(&self, full: bool) -> Verdict {
        if self.passed() {
            Verdict::Reached
        } else if !full && self.accept.meets(self.interval) {
            Verdict::Open
        } else {
            Verdict::Missed
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_is_not_accepted() {
        for accept in [Accept::AtMost(1.0), Accept::AtLeast(-1.0), Accept::Within(-1.0, 1.0)] {
            assert!(accept.holds(0.0) && !accept.holds(f64::NAN), "{accept:?}");
        }
        assert!(!Accept::AtMost(1.0).holds(1.1) && !Accept::AtLeast(1.0).holds(0.9));
        assert!(!Accept::Within(0.0, 1.0).holds(1.1) && Accept::Shown.holds(f64::NAN));
        assert!(!Accept::AtMost(1.0).meets((f64::NAN, f64::NAN)));
    }

    #[test]
    fn few_trials_leave_open_what_their_interval_does_not_decide() {
        let figure = |low| Figure::new(1, "a", "", 1.1, Accept::AtMost(1.0)).between((low, 1.2));
        assert_eq!(figure(0.9).verdict(false), Verdict::Open);
        assert_eq!(figure(0.9).verdict(true), Verdict::Missed);
        assert_eq!(figure(1.05).verdict(false), Verdict::Missed);
        assert_eq!(
            Figure::new(1, "a", "", 1.0, Accept::AtMost(1.0)).verdict(true),
            Verdict::Reached
        );
    }
}
