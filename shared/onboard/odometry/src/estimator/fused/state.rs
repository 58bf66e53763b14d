//! The fused filter's whole state, and how a record carries it on: a pure function, gone through
//! again wherever the past turns out to have been otherwise.

use kerbside_messages::{FilterState, Nanos};

use super::block::{Block, Verdict};
use super::fix::{Sighting, Surprise};
use super::joint::{Joint, Piece, Values};
use super::record::Record;
use super::rows::{self, GYRO, Measures, ROWS, Row, STEERING};
use super::setup::Setup;
use crate::estimator::increment::Increment;
use crate::wheels::elapsed;

/// Ways are smoothed over so many readings.
const SMOOTHING: f64 = 1.0 / 8.0;

/// Without a steering sensor the course is smoothed over this share of the wheelbase.
const COURSE: f64 = 0.02;

/// And known after so many times that way.
const SEEN: f64 = 4.0;

/// A block has at most so many records, so that it can be gone through again.
const LONGEST: u32 = 200;

/// State at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct State {
    pub(crate) joint: Joint,
    pub(crate) block: Block,
    measures: Measures,
    /// Way that no weight has yet taken up \[m\].
    pending: f64,
    /// Smoothed (distance, L turn), for the direction of front wheels without steering sensor.
    course: [f64; 2],
    /// Way over which the course was seen \[m\].
    seen: f64,
    /// What the pose has rolled of each wheel's way that its counter has not told yet.
    owed: [Owed; 4],
    /// The newest stamp whose record or fix is in it.
    pub(crate) time: Nanos,
    /// What the fix under judgement said.
    pub(crate) judged: Option<Surprise>,
}

/// A wheel's way while it was not read: its counter tells it with the next reading, and the pose
/// owes it nothing but the difference.
#[derive(Clone, Copy, Debug, Default)]
struct Owed {
    /// Travel as the others told it \[m\].
    travel: f64,
    /// Way meanwhile \[m\].
    way: f64,
}

/// What a record did.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Applied {
    pub(crate) increment: Increment,
    pub(crate) verdict: Option<Verdict>,
}

/// A record's rows and their solution.
struct Solved {
    rows: [Row; ROWS],
    piece: Piece,
    way: f64,
    rest: f64,
}

impl State {
    pub(crate) fn new(setup: &Setup) -> Self {
        let joint = Joint::new(setup.prior.covariance);
        Self {
            measures: Measures::new(setup, &joint.deviation),
            joint,
            block: Block::default(),
            pending: 0.0,
            course: [0.0; 2],
            seen: 0.0,
            owed: [Owed::default(); 4],
            time: 0,
            judged: None,
        }
    }

    /// Writes down all but the pose.
    pub(crate) fn save(&self, out: &mut FilterState) {
        self.joint.save(out);
        self.block.save(out);
        (out.pending, out.course, out.seen) = (self.pending, self.course, self.seen);
        out.owed_travel = self.owed.map(|owed| owed.travel);
        out.owed_way = self.owed.map(|owed| owed.way);
        out.time = self.time;
    }

    /// Takes it up again about the present pose; nothing, and false, where it is no covariance.
    pub(crate) fn load(&mut self, setup: &Setup, saved: &FilterState) -> bool {
        if !self.joint.load(saved) {
            return false;
        }
        self.measures = Measures::new(setup, &self.joint.deviation);
        self.block.load(saved);
        (self.pending, self.course, self.seen) = (saved.pending, saved.course, saved.seen);
        self.owed = core::array::from_fn(|wheel| Owed {
            travel: saved.owed_travel[wheel],
            way: saved.owed_way[wheel],
        });
        self.time = saved.time;
        true
    }

    pub(crate) fn measures(&self) -> &Measures {
        &self.measures
    }

    /// Cosine and sine of the virtual centre wheel's direction: what the sensor reads, else as the
    /// vehicle went until now.
    pub(crate) fn centre(&self, record: &Record) -> (f64, f64) {
        if let Some(steered) = &record.steered {
            return self.measures.straightened(steered.direction);
        }
        let [distance, across] = self.course;
        let length = (distance * distance + across * across).sqrt();
        if length < 1e-12 {
            return (1.0, 0.0);
        }
        let side = if distance < 0.0 { -1.0 } else { 1.0 };
        (side * distance / length, side * across / length)
    }

    /// Whether the front wheels' direction is known.
    pub(crate) fn steers(&self, record: &Record) -> bool {
        record.steered.is_some() || self.seen > SEEN * COURSE * self.measures.wheelbase
    }

    /// Carries the state over `record`, with the `fixes` of that time in order. None, and nothing
    /// changed, where the record does not tell the motion.
    pub(crate) fn apply(
        &mut self,
        setup: &Setup,
        number: u64,
        record: &Record,
        fixes: &[Sighting],
        hold: bool,
    ) -> Option<Applied> {
        let solved = self.solve(setup, record)?;
        let increment = solved.piece.increment;
        let mut verdict = None;
        if record.gap.is_some() {
            self.block.clear();
            self.seen = 0.0;
        } else if self.block.reverses(increment.distance) {
            verdict = Some(self.close(setup, hold));
        }
        if record.gap.is_none() {
            self.block.add(number, solved.way, &solved.rows, &increment);
        }
        self.pending = solved.rest;
        self.follow(&increment);
        self.owe(setup, record, &solved);
        self.roll(setup, record, &solved.piece, fixes);
        let full = self.block.way >= setup.block || self.block.records >= LONGEST;
        if full && verdict.is_none_or(|verdict| verdict.suspect.is_none()) {
            verdict = Some(self.close(setup, hold));
        }
        Some(Applied { increment, verdict })
    }

    /// Rolls along a record's piece, stopping at each fix.
    fn roll(&mut self, setup: &Setup, record: &Record, piece: &Piece, fixes: &[Sighting]) {
        let mut done = 0.0;
        for fix in fixes {
            let share = record.share(fix.stamp).max(done);
            if share > done {
                self.joint.roll(&piece.part(share - done));
                done = share;
            }
            self.correct(setup, fix);
        }
        if done == 0.0 {
            self.joint.roll(piece);
        } else if done < 1.0 {
            self.joint.roll(&piece.part(1.0 - done));
        }
        if let Some(curvature) = record.gap {
            self.blur(curvature, &piece.increment, record);
        }
        let mut drift = setup.drift(0.0, elapsed(record.end, record.start));
        drift *= if record.turned.is_some() { 1.0 } else { 0.0 };
        self.joint.drift(&drift);
        self.time = record.end;
    }

    /// The path over a gap is known by its ends only: a vehicle that steers to full lock one way
    /// and the other leaves the arc between them by up to curvature D^2/8 across and curvature^2
    /// D^3/24 along; where the heading does not come from the rear wheels, it is unknown as well.
    fn blur(&mut self, curvature: f64, motion: &Increment, record: &Record) {
        let distance = motion.distance.abs();
        let bend = curvature * distance;
        let across = (bend / 8.0).min(1.0) * distance;
        let along = (bend * bend / 24.0).min(1.0) * distance;
        let yaw = if record.rear_tells() { 0.0 } else { 0.5 * bend };
        self.joint.blur(along, across, yaw);
    }

    /// Takes a fix at the present time, if it is known to be good or within the gate.
    pub(crate) fn correct(&mut self, setup: &Setup, fix: &Sighting) {
        self.time = self.time.max(fix.stamp);
        if fix.judged {
            let surprise = fix.surprise(&self.joint);
            self.judged = Some(surprise);
            if surprise.ratio > setup.gate {
                return;
            }
        }
        let before = self.joint.deviation;
        fix.correct(&mut self.joint);
        self.relearn(setup, &before);
    }

    fn close(&mut self, setup: &Setup, hold: bool) -> Verdict {
        let before = self.joint.deviation;
        let verdict = self.block.close(setup, &mut self.joint, hold);
        self.relearn(setup, &before);
        verdict
    }

    /// The believed measures follow the parameters.
    pub(crate) fn relearn(&mut self, setup: &Setup, before: &Values) {
        let change = self.joint.deviation - before;
        if change != Values::zeros() {
            self.measures = Measures::new(setup, &self.joint.deviation);
            if self.block.records > 0 {
                self.block.shift(&change);
            }
        }
    }

    fn follow(&mut self, motion: &Increment) {
        let side = if self.course[0] * motion.distance < 0.0 { -1.0 } else { 1.0 };
        let now = [motion.distance, self.measures.wheelbase * motion.turn];
        let way = now[0].abs() + now[1].abs();
        let length = COURSE * self.measures.wheelbase;
        let kept = length / (length + way);
        self.seen += way;
        for (smooth, value) in self.course.iter_mut().zip(now) {
            *smooth = kept * (*smooth + side * value);
        }
    }

    /// Wheels that this record does not tell of are owed its motion.
    fn owe(&mut self, setup: &Setup, record: &Record, solved: &Solved) {
        for wheel in (0..4).filter(|wheel| setup.wheels[*wheel]) {
            if record.read[wheel] || record.begun[wheel] {
                self.owed[wheel] = Owed::default();
                continue;
            }
            let row = self.measures.wheel(wheel, 0.0, self.centre(record), 0.0);
            let motion = &solved.piece.increment;
            let owed = &mut self.owed[wheel];
            owed.travel += row.of[0] * motion.distance + row.of[1] * motion.turn;
            owed.way += if record.gap.is_some() { setup.block } else { solved.way };
        }
    }

    /// Whether no wheel is owed anything.
    pub(crate) fn square(&self) -> bool {
        self.owed.iter().all(|owed| owed.way == 0.0)
    }

    /// Travel of a wheel within `record` alone.
    fn travel(&self, record: &Record, wheel: usize) -> f64 {
        record.travel[wheel] - self.owed[wheel].travel / self.measures.scale[wheel]
    }

    fn solve(&self, setup: &Setup, record: &Record) -> Option<Solved> {
        let centre = self.centre(record);
        let pending = self.pending + self.way(record, centre);
        // What is held back is a block at most, and leaves evenly: noise that grows with the square of the way would grow
        // with every lump.
        let smooth = (SMOOTHING * pending).max(pending - setup.block);
        let way = if record.gap.is_some() { pending } else { smooth };
        let mut rows = self.rows(setup, record, centre, way);
        if record.gap.is_some() && record.rear_tells() {
            rows.iter_mut()
                .enumerate()
                .for_each(|(index, row)| row.used &= index == 2 || index == 3);
        }
        let piece = rows::solve(&mut rows, setup.wheelbase).or_else(|| {
            rows = self.rows(setup, record, centre, way);
            rows.iter_mut().for_each(|row| row.used = row.live);
            rows::solve(&mut rows, setup.wheelbase)
        })?;
        Some(Solved { rows, piece, way, rest: pending - way })
    }

    /// The way of the virtual centre wheel, from all wheels alike: by its own reading each wheel
    /// would weigh the more the less it reads.
    fn way(&self, record: &Record, centre: (f64, f64)) -> f64 {
        let (mut rolled, mut ways) = (0.0, 0.0);
        for wheel in (0..4).filter(|wheel| record.read[*wheel]) {
            rolled += self.travel(record, wheel).abs();
            ways += if wheel < 2 {
                self.measures.front(wheel, centre).1
            } else {
                self.measures.rear(wheel, centre)
            };
        }
        if ways > 0.0 { rolled / ways } else { 0.0 }
    }

    fn rows(&self, setup: &Setup, record: &Record, centre: (f64, f64), way: f64) -> [Row; ROWS] {
        let mut rows = [Row::default(); ROWS];
        for wheel in (0..4).filter(|wheel| record.read[*wheel]) {
            let owed = &self.owed[wheel];
            let noise = setup.wheel_variance[wheel] * (way + owed.way);
            let travel = self.travel(record, wheel);
            rows[wheel] = self.measures.wheel(wheel, travel, centre, noise);
            rows[wheel].live = owed.way < setup.block
                && (wheel >= 2 || self.steers(record) || record.gap.is_some());
            rows[wheel].used = rows[wheel].live && record.believed(wheel);
        }
        if let Some(steered) = &record.steered {
            rows[STEERING] = self.measures.steering(centre, steered.variance * way * way);
        }
        if let Some(turned) = &record.turned {
            rows[GYRO] = self.measures.gyro(turned.turn, turned.variance, turned.time);
        }
        rows
    }
}

impl Record {
    /// Share of its way that was rolled at `stamp`.
    #[allow(clippy::cast_precision_loss)] // Some milliseconds in nanoseconds are exact.
    fn share(&self, stamp: Nanos) -> f64 {
        let whole = self.end.saturating_sub(self.start);
        if stamp >= self.end || whole == 0 {
            return 1.0;
        }
        stamp.saturating_sub(self.start) as f64 / whole as f64
    }
}
