//! The newest few times of something that may happen, but not often.

use kerbside_messages::Nanos;

/// The most times that are remembered; a configured limit beyond it is refused by the bounds.
pub(crate) const MAX_RECENT: usize = 32;

/// Tells whether something happened `limit` times within a window.
#[derive(Clone, Debug, Hash)]
pub(crate) struct Recent {
    times: [Nanos; MAX_RECENT],
    limit: usize,
    count: usize,
}

impl Recent {
    /// Watches for `limit` times, at least one.
    pub(crate) fn new(limit: u32) -> Self {
        let limit = usize::try_from(limit).unwrap_or(MAX_RECENT).clamp(1, MAX_RECENT);
        Self { times: [0; MAX_RECENT], limit, count: 0 }
    }

    /// It happened at `now`; whether that was the last of `limit` times within `window`.
    pub(crate) fn happened(&mut self, now: Nanos, window: Nanos) -> bool {
        self.times[..self.limit].rotate_right(1);
        self.times[0] = now;
        self.count = (self.count + 1).min(self.limit);
        self.count == self.limit && now.saturating_sub(self.times[self.limit - 1]) <= window
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_within_the_window_alone() {
        let mut recent = Recent::new(3);
        assert!(!recent.happened(0, 10));
        assert!(!recent.happened(5, 10));
        assert!(!recent.happened(11, 10), "0, 5, 11 span more than the window");
        assert!(recent.happened(15, 10), "5, 11, 15 do not");
        assert!(Recent::new(1).happened(7, 0));
        assert!(Recent::new(0).happened(7, 0), "a limit of none is one");
    }
}
