//! The fused filter: every sensor a measurement of the motion, weighed by its own noise.
//!
//! Each reading gives one row per wheel, one for the steering angle, one for the gyro; weighted
//! least squares gives the motion and its covariance, which roll the pose along one exact arc. What
//! the sensors have in common (radii, tracks, wheelbase, steering zero, gyro bias) is carried as
//! parameters with the prior of the calibration; they learn, after each block of path, from what
//! the rows disagree about, and what no row can tell (the common scale) keeps its covariance. A
//! wheel that contradicts the others is left out of its block, an axle that slips of the window in
//! which it does: the newest past is kept and gone through again. So are late fixes.

mod algebra;
mod axles;
mod block;
mod contradiction;
mod fix;
mod history;
mod joint;
mod record;
mod rows;
mod setup;
mod state;
mod steering;

use kerbside_messages::{FilterState, Fix, Nanos, Odometry, Travel, WheelUse};

use super::bits::{bits, of_bits};
use super::increment::{Estimate, Increment};
use crate::parameters::{Parameter, ParameterEstimate};
use axles::Axle;
use block::Verdict;
use contradiction::Contradiction;
use fix::Sighting;
use history::History;
pub(crate) use record::Turned;
use record::{AxleSums, Record};
pub(crate) use setup::{LEAST_VARIANCE, Setup, wheel_noise};
use state::State;
use steering::SteeringTrack;

/// A wheel that was left out is believed again once it agrees to within this share of the gate.
const FORGIVEN: f64 = 0.4;

/// What a travel brings to the filter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading {
    /// Since when the wheels may have turned, and until when \[ns\].
    pub(crate) start: Nanos,
    pub(crate) end: Nanos,
    /// Travel of each wheel since its previous reading \[m\], whether there is one, and whether it
    /// is read for the first time.
    pub(crate) travel: [f64; 4],
    pub(crate) read: [bool; 4],
    pub(crate) begun: [bool; 4],
    /// Whether its readings are of the same moments as those of the others.
    pub(crate) aligned: [bool; 4],
    pub(crate) turned: Option<Turned>,
    /// Largest curvature \[1/m\], where the path to here was not seen.
    pub(crate) gap: Option<f64>,
}

impl Reading {
    /// Whether any wheel turned.
    pub(crate) fn moves(&self) -> bool {
        (0..4).any(|wheel| self.read[wheel] && self.travel[wheel] != 0.0)
    }
}

/// What the filter says of itself.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Statistics {
    /// Innovation of the newest fix, and its squared Mahalanobis length.
    pub(crate) innovation: [f64; 3],
    pub(crate) test_ratio: f64,
    /// Of the newest block: squared sum of what the rows say beyond the motion, per degree of
    /// freedom.
    pub(crate) block_ratio: f64,
    pub(crate) wheel_ratio: [f64; 4],
    /// Blocks and fixes taken, wheels and axles left out.
    pub(crate) corrections: u32,
    pub(crate) gated: u32,
    pub(crate) corrected: bool,
}

/// What became of a fix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Taken {
    Corrected,
    /// The same, after the covariance was widened.
    Widened,
    Contradicts,
    TooOld,
}

/// The filter with its past.
#[derive(Clone, Debug)]
pub(crate) struct Fused {
    setup: Setup,
    state: State,
    history: History,
    steering: SteeringTrack,
    sums: AxleSums,
    /// Number of the record after which the window begins.
    window: Option<u64>,
    slipping: Option<Axle>,
    /// Way at which it began to \[m\].
    slipped: f64,
    distrusted: [bool; 4],
    read: [bool; 4],
    contradiction: Contradiction,
    statistics: Statistics,
}

impl Fused {
    pub(crate) fn new(setup: Setup) -> Self {
        let state = State::new(&setup);
        Self {
            history: History::new(&state),
            state,
            setup,
            steering: SteeringTrack::default(),
            sums: AxleSums::default(),
            window: None,
            slipping: None,
            slipped: 0.0,
            distrusted: [false; 4],
            read: [false; 4],
            contradiction: Contradiction::default(),
            statistics: Statistics::default(),
        }
    }

    /// The pose is `estimate` now, whatever it was.
    pub(crate) fn place(&mut self, estimate: &Estimate) {
        self.state.joint.place(estimate);
        self.state.block.clear();
        self.history.forget();
        self.window = None;
        self.contradiction.clear();
    }

    /// Writes down what a later life needs besides the pose.
    pub(crate) fn save(&self, out: &mut FilterState) {
        self.state.save(out);
        self.steering.save(out);
        out.distrusted = bits(self.distrusted);
        out.basis = self.setup.basis;
    }

    /// What an earlier life knew. Where that was of another vehicle or prior, only its pose, and
    /// what it had in common with the parameters is not known any more; twice its covariance bounds
    /// that (the covariance of a sum is at most twice the sum of the covariances).
    pub(crate) fn inherit(&mut self, estimate: &Estimate, known: &Odometry) {
        let saved = &known.filter_state;
        self.place(estimate);
        if saved.basis == self.setup.basis && self.state.load(&self.setup, saved) {
            self.state.block.first = self.history.next();
            self.steering.load(saved, known.steering);
            self.distrusted = of_bits(saved.distrusted);
            self.statistics.wheel_ratio = known.wheel_ratio;
            self.statistics.block_ratio = known.block_ratio;
            return;
        }
        self.state.time = known.header.stamp;
        let uncertain = self.setup.prior.covariance.diagonal().max() > 0.0;
        let factor = if uncertain { 2.0 } else { 1.0 };
        self.place(&Estimate { covariance: factor * estimate.covariance, ..*estimate });
    }

    pub(crate) fn estimate(&self) -> Estimate {
        self.state.joint.estimate()
    }

    pub(crate) fn parameters(&self) -> ParameterEstimate {
        self.state.joint.parameters()
    }

    pub(crate) fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    pub(crate) fn statistics_mut(&mut self) -> &mut Statistics {
        &mut self.statistics
    }

    /// What is done with each wheel at present.
    pub(crate) fn uses(&self) -> [WheelUse; 4] {
        let slipping = self.slipping.map_or([false; 4], Axle::wheels);
        core::array::from_fn(|wheel| {
            if !self.read[wheel] {
                WheelUse::None
            } else if slipping[wheel] {
                WheelUse::Slipping
            } else if self.distrusted[wheel] {
                WheelUse::Gated
            } else {
                WheelUse::Used
            }
        })
    }

    /// Looks at the aids of `travel`, at each one.
    pub(crate) fn look(&mut self, travel: &Travel) {
        self.statistics.corrected = false;
        self.steering.take(travel);
    }

    /// The vehicle stands and the gyro reads `rate` with that variance: its bias, nothing else. The
    /// pose is considered, not moved: a vehicle that stands does not.
    pub(crate) fn rest(&mut self, rate: f64, variance: f64) {
        let bias = Parameter::GyroBias.index();
        let before = self.state.joint.deviation;
        self.state.joint.consider(bias, rate - before[bias], variance.max(LEAST_VARIANCE));
        self.state.relearn(&self.setup, &before);
    }

    /// Takes what the wheels rolled. None where that does not tell the motion, which is then to
    /// come with a later reading.
    pub(crate) fn step(&mut self, reading: &Reading) -> Option<Increment> {
        self.read = reading.read;
        if !reading.moves() {
            return Some(Increment {
                distance: 0.0,
                turn: 0.0,
                covariance: nalgebra::Matrix2::zeros(),
            });
        }
        let steering = self.steering;
        let mut record = self.record(reading);
        self.sums = axles::sums(&self.sums, &self.state, &record);
        record.axles = self.sums;
        let number = self.history.push(&record, &self.state);
        let slips = self.watch_axles(number);
        let hold = self.history.reaches(self.state.block.first);
        let Some(applied) = self.history.apply(&self.setup, &mut self.state, number, hold) else {
            self.history.drop_newest();
            self.sums = self.history.record(number.wrapping_sub(1)).map_or(
                AxleSums { lacking: self.sums.lacking.wrapping_add(1), ..self.sums },
                |record| record.axles,
            );
            self.steering = steering;
            return None;
        };
        if let Some(verdict) = &applied.verdict {
            self.conclude(verdict, number, hold);
        }
        if let Some(first) = slips {
            self.go_again(first);
        }
        Some(applied.increment)
    }

    fn record(&mut self, reading: &Reading) -> Record {
        let read = (0..4).filter(|wheel| reading.read[*wheel]);
        let (count, sum) = read.fold((0.0_f64, 0.0), |(count, sum), wheel| {
            (count + 1.0, sum + reading.travel[wheel].abs())
        });
        let way = sum / count.max(1.0);
        let variance = self.setup.steering_variance;
        Record {
            start: reading.start,
            end: reading.end,
            travel: reading.travel,
            read: reading.read,
            begun: reading.begun,
            aligned: reading.aligned,
            excluded: self.distrusted,
            slipping: self.slipping,
            steered: if self.setup.steered {
                self.steering.over(way, reading.end, variance)
            } else {
                None
            },
            turned: reading.turned,
            gap: reading.gap,
            axles: AxleSums::default(),
        }
    }

    /// Compares the axles over the window that ends with record `number`. An axle that begins to
    /// slip, or takes the other's place, is left out from the window's beginning on, whose number
    /// this returns.
    fn watch_axles(&mut self, number: u64) -> Option<u64> {
        let now = *self.history.record(number)?;
        let mut window = self.window.unwrap_or(number).max(self.history.oldest());
        let aged = |begin: u64| {
            let next = self.history.record(begin + 1);
            next.is_some_and(|next| next.end + axles::WINDOW <= now.end)
        };
        while aged(window) {
            window += 1;
        }
        self.window = Some(window);
        let then = self.history.record(window)?.axles;
        if let Some(wheel) = axles::dead(&self.state, &now, &then, &self.setup) {
            self.slipping = None;
            return self.give_up(wheel, window);
        }
        let found = axles::slipping(&self.setup, &self.state, &then, &now.axles);
        let begins = self.slipping.is_none();
        let blind = self.blind(&now, begins);
        let before = self.slipping;
        // An axle that was named without evidence gives way to one that is named with it.
        self.slipping = found.map(|slip| match before {
            Some(_) if blind => Axle::Front,
            Some(axle) if !slip.evident => axle,
            _ => slip.axle,
        });
        let axle = self.slipping.filter(|_| self.slipping != before)?;
        self.statistics.gated = self.statistics.gated.wrapping_add(u32::from(begins));
        self.history.slip(window, axle);
        Some(window)
    }

    /// Leaves out a wheel whose counter stands still, from the window's beginning on.
    fn give_up(&mut self, wheel: usize, window: u64) -> Option<u64> {
        let known = std::mem::replace(&mut self.distrusted[wheel], true);
        if known {
            return None;
        }
        self.statistics.gated = self.statistics.gated.wrapping_add(1);
        self.history.exclude(window, core::array::from_fn(|index| index == wheel));
        Some(window)
    }

    /// Whether the rear axle has been left out for longer than the front alone tells the heading.
    fn blind(&mut self, now: &Record, begins: bool) -> bool {
        if begins {
            self.slipped = now.axles.way;
        }
        let way = now.axles.way - self.slipped;
        !self.setup.steered && way > axles::BLIND * self.setup.wheelbase
    }

    /// What a block's end means for the wheels, and whether it is to be gone through again.
    fn conclude(&mut self, verdict: &Verdict, number: u64, hold: bool) {
        for wheel in 0..4 {
            if verdict.tested[wheel] {
                self.statistics.wheel_ratio[wheel] = verdict.ratios[wheel];
            }
            let agrees = verdict.ratios[wheel] < FORGIVEN * self.setup.wheel_gate;
            self.distrusted[wheel] &= !(verdict.tested[wheel] && agrees);
        }
        if verdict.freedom > 0 {
            self.statistics.block_ratio = verdict.square / f64::from(verdict.freedom);
        }
        if verdict.learnt {
            self.statistics.corrections = self.statistics.corrections.wrapping_add(1);
            self.statistics.corrected = true;
        }
        if let Some(wheel) = verdict.suspect {
            self.distrusted[wheel] = true;
            self.statistics.gated = self.statistics.gated.wrapping_add(1);
            if hold {
                let first = verdict.first.min(number);
                let wheels = core::array::from_fn(|index| index == wheel);
                self.history.exclude(first, wheels);
                self.go_again(first);
            }
        }
    }

    fn go_again(&mut self, first: u64) {
        if let Some(state) = self.history.again_from(&self.setup, first) {
            self.state = state;
        }
    }

    /// Takes an absolute pose at its own time; what was rolled since is gone through again.
    ///
    /// Where it contradicts the estimate as those before it did, the covariance is widened until it does not.
    pub(crate) fn fix(&mut self, fix: &Fix) -> Taken {
        let sighting = Sighting::new(fix);
        let taken = self.judge(&sighting, self.setup.gate);
        match taken {
            Taken::Contradicts => {}
            Taken::TooOld => return taken,
            Taken::Corrected | Taken::Widened => {
                self.contradiction.clear();
                return taken;
            }
        }
        let innovation = self.statistics.innovation.into();
        let spread = sighting.spread(&self.state.joint);
        if !self.contradiction.refused(innovation, &spread) {
            return taken;
        }
        for _ in 0..contradiction::STEPS {
            self.widen(contradiction::STEP);
            if self.judge(&sighting, contradiction::ORDINARY) == Taken::Corrected {
                self.contradiction.clear();
                return Taken::Widened;
            }
        }
        // Not even so: it stays as sure as it was. Powers of two leave nothing behind.
        (0..contradiction::STEPS).for_each(|_| self.widen(1.0 / contradiction::STEP));
        taken
    }

    fn widen(&mut self, factor: f64) {
        self.state.joint.widen(factor);
        self.history.widen(factor);
    }

    /// The same, refused beyond `gate`.
    fn judge(&mut self, sighting: &Sighting, gate: f64) -> Taken {
        let own = std::mem::replace(&mut self.setup.gate, gate);
        let taken = self.take(sighting);
        self.setup.gate = own;
        taken
    }

    fn take(&mut self, sighting: &Sighting) -> Taken {
        self.state.judged = None;
        let before = self.state;
        self.history.insert(sighting);
        if sighting.stamp >= self.state.time {
            self.state.correct(&self.setup, sighting);
        } else {
            let Some(state) = self.history.again_before(&self.setup, sighting.stamp) else {
                self.history.settle(false);
                return Taken::TooOld;
            };
            self.state = state;
        }
        let ratio = self.state.judged.map_or(f64::MAX, |surprise| surprise.ratio);
        if let Some(surprise) = self.state.judged {
            self.statistics.innovation = surprise.innovation.into();
        }
        self.statistics.test_ratio = ratio;
        let good = ratio <= self.setup.gate;
        self.history.settle(good);
        if !good {
            self.state = before;
            return Taken::Contradicts;
        }
        self.statistics.corrections = self.statistics.corrections.wrapping_add(1);
        self.statistics.corrected = true;
        Taken::Corrected
    }
}
