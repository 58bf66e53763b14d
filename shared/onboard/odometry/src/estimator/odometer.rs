//! How far each wheel has rolled, and how much of that is in the pose.

use kerbside_messages::{FilterState, Travel, WheelStatus};

use super::bits::{bits, of_bits};
use crate::wheels::WheelScale;

/// Over a gap a wheel may have turned so many times faster than its top speed, the vehicle may have
/// accelerated so many times harder than its limits say, and stamps may be off by so much \[s\],
/// before the pose counts as lost.
const GAP_MARGIN: f64 = 5.0;
const GAP_ACCELERATION: f64 = 3.0;
const GAP_SLACK: f64 = 0.1;

/// A time over which the wheels were not read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gap {
    /// How long it was \[s\].
    pub(crate) elapsed: f64,
    /// The vehicle's speed before it, where it is known \[m/s\].
    pub(crate) speed: Option<f64>,
    /// Top speed \[m/s\] of the vehicle.
    pub(crate) top_speed: f64,
    /// The larger of its acceleration and deceleration \[m/s^2\].
    pub(crate) acceleration: f64,
}

impl Gap {
    /// Whether `turned` metres of a wheel are not what the speed before and any acceleration make
    /// of the time, for a wheel up to `factor` times as fast as the vehicle and `slack` metres.
    fn contradicts(&self, turned: f64, factor: f64, slack: f64) -> bool {
        let Some(speed) = self.speed else { return false };
        let held = speed * self.elapsed;
        let gained = 0.5 * GAP_ACCELERATION * self.acceleration * self.elapsed * self.elapsed;
        let around = (factor - 1.0) * held.abs() + factor * (gained + speed.abs() * GAP_SLACK);
        (turned - held).abs() > around + slack
    }

    /// How far a wheel up to `factor` times as fast as the vehicle comes in the time \[m\].
    fn reach(&self, factor: f64) -> f64 {
        let elapsed = self.elapsed + GAP_SLACK;
        let most = self.top_speed * elapsed;
        let way = self.speed.map_or(most, |speed| {
            speed.abs() * elapsed + 0.5 * self.acceleration * elapsed * elapsed
        });
        factor * way.min(most)
    }
}

/// What a travel brought.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Brought {
    /// At least one wheel was read.
    pub(crate) wheels: bool,
    /// At least one wheel turned.
    pub(crate) motion: bool,
    /// A wheel's number comes from another life of ingest than the one before.
    pub(crate) bridged: bool,
    /// A wheel that the pose needs was looked for, and not all of them were usable.
    pub(crate) lacking: bool,
}

/// Each wheel's travel of the counter epoch: the newest, and the one the pose stands for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Odometer {
    scales: [WheelScale; 4],
    needed: [bool; 4],
    newest: [f64; 4],
    applied: [f64; 4],
    /// A newest travel of this epoch is known.
    known: [bool; 4],
    /// A zero of this epoch is known.
    based: [bool; 4],
    /// Read since the pose took it up.
    fresh: [bool; 4],
    /// A travel was known when the pose was rolled last.
    tracked: [bool; 4],
    /// Not read between the last two times that the pose was rolled.
    lost: [bool; 4],
    /// Read with the newest travel, and with that with which the pose was rolled last.
    now: [bool; 4],
    then: [bool; 4],
}

impl Odometer {
    /// Of a model that computes the pose from the wheels `needed`.
    pub(crate) fn new(scales: [WheelScale; 4], needed: [bool; 4]) -> Self {
        let no = [false; 4];
        let zero = [0.0; 4];
        Self {
            scales,
            needed,
            newest: zero,
            applied: zero,
            known: no,
            based: no,
            fresh: no,
            tracked: no,
            lost: no,
            now: no,
            then: no,
        }
    }

    /// Another counter epoch: no travel of the old one means anything.
    pub(crate) fn forget(&mut self) {
        *self = Self::new(self.scales, self.needed);
    }

    /// Writes down which wheels the pose knows.
    pub(crate) fn save(&self, out: &mut FilterState) {
        out.based = bits(self.tracked);
        out.lost = bits(self.lost);
        out.read = bits(self.then);
    }

    /// The pose stands for `applied` travels of the present epoch, whatever was taken up so far. A
    /// wheel that the earlier life never read begins with its next reading.
    pub(crate) fn restore(&mut self, applied: [f64; 4], saved: &FilterState) {
        self.tracked = of_bits(saved.based);
        self.lost = of_bits(saved.lost);
        self.then = of_bits(saved.read);
        self.fresh = self.known;
        for (wheel, applied) in applied.into_iter().enumerate() {
            if self.tracked[wheel] {
                (self.applied[wheel], self.based[wheel]) = (applied, true);
                if !self.known[wheel] {
                    self.newest[wheel] = applied;
                }
            } else {
                self.applied[wheel] = self.newest[wheel];
            }
        }
    }

    /// Takes what `travel` says of the wheels. Differences of cumulative travel alone are used, so
    /// that a lost sample loses no motion.
    pub(crate) fn read(&mut self, travel: &Travel) -> Brought {
        let mut brought = Brought::default();
        let mut unusable = false;
        self.now = [false; 4];
        for index in 0..4 {
            let status = travel.wheel(index);
            if matches!(status, WheelStatus::Valid | WheelStatus::Zeroed) {
                brought.wheels = true;
                brought.bridged |= status == WheelStatus::Zeroed && self.based[index];
                brought.motion |= self.take(index, travel.travel[index]);
            } else if self.needed[index] {
                unusable = true;
                brought.lacking |= status == WheelStatus::Implausible;
            }
        }
        let seen = (0..4).any(|index| self.needed[index] && self.fresh[index]);
        brought.lacking |= unusable && brought.wheels && seen;
        brought
    }

    fn take(&mut self, index: usize, travel: f64) -> bool {
        let before = std::mem::replace(&mut self.newest[index], travel);
        let turned = self.known[index] && travel != before;
        self.known[index] = true;
        self.now[index] = true;
        self.fresh[index] = true;
        if !self.based[index] {
            self.applied[index] = travel;
            self.based[index] = true;
        }
        turned
    }

    /// Whether every needed wheel was read since the pose took it up.
    pub(crate) fn ready(&self) -> bool {
        (0..4).all(|index| !self.needed[index] || self.fresh[index])
    }

    /// The same, without wheels that the pose went on without.
    pub(crate) fn ready_without_lost(&self) -> bool {
        (0..4).all(|index| !self.needed[index] || self.fresh[index] || self.lost[index])
    }

    /// Travel of a wheel that is not yet in the pose \[m\].
    pub(crate) fn unapplied(&self, index: usize) -> f64 {
        self.scales[index].difference(self.newest[index], self.applied[index])
    }

    /// The largest of them among the wheels read, for the time in which another wheel is awaited
    /// \[m\].
    pub(crate) fn awaiting(&self) -> f64 {
        let pending = |index: usize| self.needed[index] && self.fresh[index];
        let largest = |most: f64, index: usize| most.max(self.unapplied(index).abs());
        (0..4).filter(|index| pending(*index)).fold(0.0, largest)
    }

    /// Whether a wheel has turned over a gap as none can: farther than its top speed carries it,
    /// or so far off the way that the speed before the gap foretells that no acceleration explains
    /// it, or maybe so far that absolute counts no longer tell; or whether the counters may have
    /// begun anew unseen.
    pub(crate) fn beyond_belief(&self, gap: &Gap) -> bool {
        let used = |index: &usize| self.needed[*index] && !self.lost[*index];
        self.may_have_begun_anew(gap)
            || (0..4).filter(used).any(|index| {
                let scale = &self.scales[index];
                let turned = self.unapplied(index);
                let counts = 2.0 * scale.metres_per_count;
                let reach = GAP_MARGIN * scale.top_speed * (gap.elapsed + GAP_SLACK);
                turned.abs() > reach + counts
                    || gap.contradicts(turned, scale.top_speed / gap.top_speed, counts)
                    || scale.top_speed * gap.elapsed > 0.5 * scale.ring()
            })
    }

    /// Whether all counters are as near their zero as they would be had they begun anew within the
    /// gap: how far the vehicle came before that, nobody knows. Over a gap as short as the slack
    /// that is no way to speak of, and counters that read what they did before have not moved.
    fn may_have_begun_anew(&self, gap: &Gap) -> bool {
        if gap.elapsed <= GAP_SLACK {
            return false;
        }
        let used = |index: &usize| self.needed[*index] && !self.lost[*index];
        let counts = |index: usize| 2.0 * self.scales[index].metres_per_count;
        let near_zero = |index: usize| {
            let scale = &self.scales[index];
            scale.metres_per_count > 0.0
                && self.newest[index].abs()
                    <= gap.reach(scale.top_speed / gap.top_speed) + counts(index)
        };
        (0..4).filter(used).all(near_zero)
            && (0..4).filter(used).any(|index| self.unapplied(index).abs() > counts(index))
    }

    /// The pose has taken up all that was read.
    pub(crate) fn apply(&mut self) {
        self.applied = self.newest;
        self.tracked = self.based;
        self.lost = self.fresh.map(|fresh| !fresh);
        self.fresh = [false; 4];
        self.then = self.now;
    }

    /// Which wheels tell it over the very time since the pose was rolled last: their readings are
    /// of one moment, then and now.
    pub(crate) fn aligned(&self) -> [bool; 4] {
        core::array::from_fn(|index| self.now[index] && self.then[index])
    }

    /// Which wheels were read for the first time: they tell nothing yet.
    pub(crate) fn beginning(&self) -> [bool; 4] {
        core::array::from_fn(|index| self.fresh[index] && !self.tracked[index])
    }

    /// Which wheels tell how far they turned since the pose took them up.
    pub(crate) fn telling(&self) -> [bool; 4] {
        core::array::from_fn(|index| self.fresh[index] && self.tracked[index])
    }

    /// The newest travels \[m\].
    pub(crate) fn newest(&self, index: usize) -> f64 {
        self.newest[index]
    }

    /// Travel from `before` to the newest \[m\].
    pub(crate) fn since(&self, index: usize, before: f64) -> f64 {
        self.scales[index].difference(self.newest[index], before)
    }

    /// The travels that the pose stands for: those it took up, and the newest of wheels it does not
    /// use. With `every` it uses them all.
    pub(crate) fn applied(&self, every: bool) -> [f64; 4] {
        let mut all = self.newest;
        for index in (0..4).filter(|index| every || self.needed[*index]) {
            all[index] = self.applied[index];
        }
        all
    }
}
