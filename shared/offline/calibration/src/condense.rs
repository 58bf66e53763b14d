//! A run, cut into blocks of a few centimetres: all that the fit needs of it, whatever the parameters.

use kerbside_geometry::{Pose, Vehicle, WHEELS};

use crate::error::CalibrationError;
use crate::gyro::{Gyro, Turned};
use crate::noise::Settings;
use crate::parameters::Parameters;
use crate::run::{ReferencePose, Run, Series};

/// The steering readings within a block, weighed by travel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Reading {
    /// Mean \[rad\].
    pub(crate) mean: f64,
    /// How far the true angle strays from it within the block, standard deviation \[rad\].
    pub(crate) spread: f64,
    /// Variance of the mean over that of one reading.
    pub(crate) variance_factor: f64,
}

/// Motion between two instants, in one direction of travel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Block {
    /// Rotation of the wheels \[rad\]; 0 where there is none.
    pub(crate) rotation: [f64; 4],
    /// The wheels' common travel \[m\].
    pub(crate) travel: f64,
    /// Travel that each wheel's noise is measured by, over its nominal radius squared \[1/m\].
    pub(crate) turned: [f64; 4],
    /// 1 forward, -1 in reverse.
    pub(crate) direction: f64,
    /// Steering; none without a sensor.
    pub(crate) steering: Option<Reading>,
    /// What the gyro turned, where it alone tells how the vehicle turned.
    pub(crate) turned_by_gyro: Option<Turned>,
    /// Stamp of its end \[s\].
    pub(crate) until: f64,
    /// Number of the comparison that the block belongs to.
    pub(crate) comparison: usize,
}

/// Something known of the motion besides wheels and steering.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Known {
    /// The marker's pose and its standard deviations \[m\], \[rad\].
    Pose { x: f64, y: f64, yaw: Option<f64>, position_deviation: f64, yaw_deviation: f64 },
    /// Travelled distance and its standard deviation \[m\].
    Distance(f64, f64),
    /// Net turn and its standard deviation \[rad\].
    Turn(f64, f64),
    /// The turn since the gyro was last looked at, its bias in it.
    Gyro(Turned),
}

/// Something known, and how many blocks were rolled by then.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Event {
    pub(crate) after: usize,
    /// Stamp \[s\].
    pub(crate) t: f64,
    /// Speed of the wheels' common travel about then, without sign \[m/s\].
    pub(crate) speed: f64,
    pub(crate) known: Known,
}

/// A condensed run.
#[derive(Clone, Debug)]
pub(crate) struct Condensed {
    pub(crate) name: String,
    /// Which wheels are used.
    pub(crate) wheels: [bool; 4],
    /// Whether the rows of front wheels and steering sensor are used.
    pub(crate) steered: bool,
    pub(crate) blocks: Vec<Block>,
    /// In order of `after`.
    pub(crate) events: Vec<Event>,
    /// Whether a gyro alone tells how the vehicle turned.
    pub(crate) spun: bool,
    /// Whether a reference saw its marker, and whether that has a heading.
    pub(crate) marked: bool,
    pub(crate) headed: bool,
    /// Travel by the nominal radii \[m\].
    pub(crate) travel: f64,
    /// Stamp of its beginning \[s\].
    pub(crate) begin: f64,
}

/// Share of the wheels' travel below which the vehicle turns on the spot.
const SPIN: f64 = 0.2;
/// Variance of a turn of which nothing is known \[rad^2\].
const ANYHOW: f64 = 1.0;
/// Time to either side over which a speed is taken \[s\].
const ABOUT: f64 = 0.2;
/// Poses of the start that are known by agreement are as good as exact \[m\], \[rad\].
const AGREED: f64 = 1e-6;

impl Condensed {
    /// Cuts `run` into blocks.
    ///
    /// # Errors
    /// Whatever in the run makes it useless: no wheels, no motion, no heading, no truth.
    pub(crate) fn new(
        run: &Run,
        vehicle: &Vehicle,
        settings: &Settings,
    ) -> Result<Self, CalibrationError> {
        let name = run.name.clone();
        let wheels = run.wheels();
        let base = Base::new(run, vehicle).ok_or(CalibrationError::NoWheels { run: name })?;
        let steered = run.steering.as_ref().is_some_and(|series| !series.is_empty());
        let name = run.name.clone();
        if base.travel() <= 0.0 {
            return Err(CalibrationError::NoMotion { run: name });
        }
        let gyro = run.yaw_rate.as_ref().and_then(Gyro::new);
        let by_wheels = usable(wheels, steered, vehicle);
        let spun = by_wheels.is_none() && gyro.is_some();
        let by_gyro = [false, false, wheels[2], wheels[3]];
        let wheels = by_wheels
            .or((spun && (wheels[2] || wheels[3])).then_some(by_gyro))
            .ok_or_else(|| CalibrationError::NoHeading { run: name.clone() })?;
        let mut known = known_of(run, settings, base.span());
        let headed = run.reference.iter().any(|reading| reading.yaw.is_some());
        // A gyro's scale is taken on trust: where something else tells the heading, that does.
        let told = headed || run.end_pose.is_some() || run.net_turn.is_some();
        if let Some(gyro) = gyro.as_ref().filter(|_| !spun && !told) {
            known.extend(looks_at(gyro, &base, settings));
        }
        if known.iter().filter(|(_, known)| !is_agreed(known)).count() == 0 {
            return Err(CalibrationError::NoTruth { run: name });
        }
        let length = block_length(settings, steered, wheels);
        let mut condensed = Self {
            name,
            wheels,
            steered,
            blocks: Vec::new(),
            events: Vec::new(),
            spun,
            marked: !run.reference.is_empty(),
            headed,
            travel: base.travel(),
            begin: base.span().0,
        };
        condensed.cut(run, &base, length, settings, known);
        if let Some(gyro) = gyro.filter(|_| spun) {
            condensed.spin(&gyro, settings);
        }
        condensed.weigh(vehicle);
        Ok(condensed)
    }

    fn cut(
        &mut self,
        run: &Run,
        base: &Base,
        length: f64,
        settings: &Settings,
        mut known: Vec<(f64, Known)>,
    ) {
        known.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let mut times = base.boundaries(length);
        times.extend(known.iter().map(|(t, _)| *t));
        times.sort_by(f64::total_cmp);
        let mut cells = run.steering.as_ref().map(|series| Cells::new(series, base));
        let mut waiting = known.into_iter().peekable();
        let mut from = base.span().0;
        for to in times {
            let (before, after) = (base.rolled(from), base.rolled(to));
            if after > before {
                self.blocks.push(Block {
                    rotation: rotation(run, from, to),
                    travel: after - before,
                    turned: [0.0; 4],
                    direction: base.direction(from, to),
                    steering: cells.as_mut().map(|cells| cells.read(before, after, settings)),
                    turned_by_gyro: None,
                    until: to,
                    comparison: comparison(before, settings),
                });
                from = to;
            }
            while let Some((t, known)) = waiting.next_if(|(t, _)| *t <= to) {
                let (after, speed) = (self.blocks.len(), base.speed(t));
                self.events.push(Event { after, t, speed, known });
            }
        }
    }

    /// Gives each block what the gyro turned since the one before; where it was silent, that the vehicle may have
    /// turned anyhow.
    fn spin(&mut self, gyro: &Gyro<'_>, settings: &Settings) {
        let mut from = self.begin;
        for block in &mut self.blocks {
            let unknown = Turned { turn: 0.0, time: 0.0, variance: ANYHOW };
            block.turned_by_gyro =
                Some(gyro.turned(from, block.until, &settings.noise).unwrap_or(unknown));
            from = block.until;
        }
    }

    /// `body_from_marker`; the body itself where it was measured by hand.
    pub(crate) fn marker(&self, parameters: &Parameters) -> Pose {
        if self.marked { parameters.marker() } else { Pose::default() }
    }

    /// Gives each wheel its share of the common travel, from its own travel over the whole comparison: its reading
    /// within a block would favour the wheel that read low.
    fn weigh(&mut self, vehicle: &Vehicle) {
        let mut at = 0;
        while at < self.blocks.len() {
            let number = self.blocks[at].comparison;
            let end = self.blocks[at..].iter().position(|block| block.comparison != number);
            let end = end.map_or(self.blocks.len(), |length| at + length);
            let mut own = [0.0; 4];
            for block in &self.blocks[at..end] {
                for (wheel, own) in own.iter_mut().enumerate() {
                    *own += (block.rotation[wheel] * vehicle.radius[wheel]).abs();
                }
            }
            let common: f64 = self.blocks[at..end].iter().map(|block| block.travel).sum();
            for block in &mut self.blocks[at..end] {
                block.turned = core::array::from_fn(|wheel| {
                    let radius = vehicle.radius[wheel];
                    block.travel * own[wheel] / (common * radius * radius)
                });
            }
            at = end;
        }
    }
}

fn comparison(rolled: f64, settings: &Settings) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative, and few
    let number = (rolled / settings.comparison) as usize;
    number
}

fn is_agreed(known: &Known) -> bool {
    matches!(known, Known::Pose { position_deviation, .. } if *position_deviation <= AGREED)
}

/// Without a steering sensor the curvature comes from the rear wheels, whose noise bends it: longer blocks make
/// that harmless.
fn block_length(settings: &Settings, steered: bool, wheels: [bool; 4]) -> f64 {
    let bent = !steered && (wheels[0] || wheels[1]);
    if bent { 5.0 * settings.block } else { settings.block }
}

/// The wheels that say something together; none where they do not say how the vehicle turns.
fn usable(mut wheels: [bool; 4], steered: bool, vehicle: &Vehicle) -> Option<[bool; 4]> {
    let rear_pair = wheels[2] && wheels[3] && vehicle.track_rear > 0.0;
    if !steered {
        if !rear_pair {
            return None;
        }
        // Without a steering sensor a single front wheel cannot be told from a wrong wheelbase.
        let front_pair = wheels[0] && wheels[1];
        wheels[0] &= front_pair;
        wheels[1] &= front_pair;
    }
    wheels.iter().any(|used| *used).then_some(wheels)
}

/// Everything known of the run besides wheels and steering, with the time it was known.
fn known_of(run: &Run, settings: &Settings, (from, to): (f64, f64)) -> Vec<(f64, Known)> {
    let noise = &settings.noise;
    let mut known = Vec::new();
    let pose = |pose: &Pose, deviation: f64, yaw_deviation: f64| Known::Pose {
        x: pose.x,
        y: pose.y,
        yaw: Some(pose.yaw),
        position_deviation: deviation,
        yaw_deviation,
    };
    for reading in thinned(&run.reference, noise.reference_interval, (from, to)) {
        let pose = Known::Pose {
            x: reading.x,
            y: reading.y,
            yaw: reading.yaw,
            position_deviation: noise.position,
            yaw_deviation: noise.yaw,
        };
        known.push((reading.t.clamp(from, to), pose));
    }
    // What was measured by hand is relative to the start, wherever that is; a reference of its own makes it
    // superfluous.
    if run.reference.is_empty() {
        let start = run.start.unwrap_or_default();
        known.push((from, pose(&start, AGREED, AGREED)));
        if let Some(end) = run.end_pose {
            let end = start.compose(&end);
            known.push((to, pose(&end, noise.hand_position, noise.hand_yaw)));
        }
    }
    known.extend(run.distance.map(|distance| (to, Known::Distance(distance, noise.distance))));
    known.extend(run.net_turn.map(|turn| (to, Known::Turn(turn, noise.turn))));
    known
}

/// What a gyro turned over each stretch on which the axles are compared.
fn looks_at(gyro: &Gyro<'_>, base: &Base, settings: &Settings) -> Vec<(f64, Known)> {
    let mut from = base.span().0;
    let mut looks = Vec::new();
    for to in base.boundaries(settings.comparison) {
        // Over a silence nothing is said: the next look begins behind it.
        let silent = Turned { turn: 0.0, time: 0.0, variance: f64::INFINITY };
        let turned = gyro.turned(from, to, &settings.noise).unwrap_or(silent);
        if to > from {
            looks.push((to, Known::Gyro(turned)));
        }
        from = to;
    }
    looks
}

/// Readings within the run's span that are far enough from one another; first and last stay in any case.
fn thinned(
    reference: &[ReferencePose],
    interval: f64,
    (from, to): (f64, f64),
) -> Vec<ReferencePose> {
    let margin = interval.max(0.1);
    let inside = |reading: &&ReferencePose| (from - margin..=to + margin).contains(&reading.t);
    let mut kept: Vec<ReferencePose> = Vec::new();
    for reading in reference.iter().filter(inside) {
        if kept.last().is_none_or(|last| reading.t - last.t >= interval) {
            kept.push(*reading);
        }
    }
    if let Some(last) = reference.iter().rfind(inside)
        && kept.last().is_some_and(|kept| kept.t < last.t)
    {
        if kept.len() > 1 {
            kept.pop();
        }
        kept.push(*last);
    }
    kept
}

fn rotation(run: &Run, from: f64, to: f64) -> [f64; 4] {
    core::array::from_fn(|wheel| {
        run.rotation[wheel].as_ref().map_or(0.0, |series| series.at(to) - series.at(from))
    })
}

/// The wheels' common travel over time, by nominal radii.
pub(crate) struct Base {
    t: Vec<f64>,
    /// Travel, reverse counted like forward \[m\].
    rolled: Vec<f64>,
    /// Travel, reverse negative \[m\].
    net: Vec<f64>,
}

impl Base {
    /// None without a wheel that was read twice.
    pub(crate) fn new(run: &Run, vehicle: &Vehicle) -> Option<Self> {
        let used = run.wheels();
        let (from, to) = run.span()?;
        let wheels: Vec<(&Series, f64)> = WHEELS
            .iter()
            .filter(|wheel| used[wheel.index()])
            .filter_map(|wheel| {
                Some((run.rotation[wheel.index()].as_ref()?, vehicle.radius[wheel.index()]))
            })
            .collect();
        let clock = wheels.iter().max_by_key(|(series, _)| series.len())?.0;
        let inside = |t: &f64| (from..=to).contains(t);
        let t: Vec<f64> = clock.t.iter().copied().filter(inside).collect();
        if t.len() < 2 {
            return None;
        }
        #[allow(clippy::cast_precision_loss)] // four at most
        let share = 1.0 / wheels.len() as f64;
        let mean =
            |t: f64| wheels.iter().map(|(wheel, radius)| wheel.at(t) * radius).sum::<f64>() * share;
        let net: Vec<f64> = t.iter().map(|t| mean(*t)).collect();
        let mut rolled = vec![0.0; net.len()];
        // Wheel by wheel: a vehicle that turns on the spot rolls, too.
        for (wheel, radius) in &wheels {
            let (mut before, mut sum) = (wheel.at(from), 0.0);
            for (rolled, t) in rolled.iter_mut().zip(&t) {
                let now = wheel.at(*t);
                sum += (now - before).abs() * radius * share;
                *rolled += sum;
                before = now;
            }
        }
        Some(Self { t, rolled, net })
    }

    pub(crate) fn travel(&self) -> f64 {
        self.rolled.last().copied().unwrap_or(0.0)
    }

    /// Travel with its direction, reverse against forward, without sign \[m\].
    pub(crate) fn net(&self) -> f64 {
        (self.net[self.net.len() - 1] - self.net[0]).abs()
    }

    pub(crate) fn span(&self) -> (f64, f64) {
        (self.t[0], self.t[self.t.len() - 1])
    }

    fn interpolate(&self, values: &[f64], t: f64) -> f64 {
        let after = self.t.partition_point(|stamp| *stamp <= t);
        if after == 0 {
            return values[0];
        }
        if after == self.t.len() {
            return values[after - 1];
        }
        let share = (t - self.t[after - 1]) / (self.t[after] - self.t[after - 1]);
        values[after - 1] + share * (values[after] - values[after - 1])
    }

    /// Travel by `t` \[m\].
    pub(crate) fn rolled(&self, t: f64) -> f64 {
        self.interpolate(&self.rolled, t)
    }

    /// Speed of the common travel about `t`, without sign \[m/s\].
    fn speed(&self, t: f64) -> f64 {
        let (begin, end) = self.span();
        let (from, to) = ((t - ABOUT).max(begin), (t + ABOUT).min(end));
        if to > from { (self.rolled(to) - self.rolled(from)) / (to - from) } else { 0.0 }
    }

    fn direction(&self, from: f64, to: f64) -> f64 {
        let net = self.interpolate(&self.net, to) - self.interpolate(&self.net, from);
        if net < 0.0 { -1.0 } else { 1.0 }
    }

    /// Ends of blocks of about `length` \[m\], and every change of the direction of travel.
    fn boundaries(&self, length: f64) -> Vec<f64> {
        let mut times = Vec::new();
        let (mut begun, mut direction) = (0.0, 0.0);
        for index in 1..self.t.len() {
            let step = self.net[index] - self.net[index - 1];
            // On the spot there is no direction of travel to change.
            let spins = step.abs() < SPIN * (self.rolled[index] - self.rolled[index - 1]);
            let step = if spins { 0.0 } else { step };
            if step * direction < 0.0 && self.rolled[index - 1] > begun {
                times.push(self.t[index - 1]);
                begun = self.rolled[index - 1];
            }
            direction = if step == 0.0 { direction } else { step };
            if self.rolled[index] - begun >= length {
                times.push(self.t[index]);
                begun = self.rolled[index];
            }
        }
        times.push(self.t[self.t.len() - 1]);
        times
    }
}

/// Steering readings, each holding for the travel nearest to it in time.
struct Cells {
    /// Travel at the cell's beginning and end \[m\], and the reading \[rad\].
    cells: Vec<(f64, f64, f64)>,
    at: usize,
}

impl Cells {
    fn new(series: &Series, base: &Base) -> Self {
        let count = series.len();
        let edge = |index: usize| match index {
            0 => 0.0,
            _ if index >= count => base.travel(),
            _ => base.rolled(0.5 * (series.t[index - 1] + series.t[index])),
        };
        let cells: Vec<_> =
            (0..count).map(|index| (edge(index), edge(index + 1), series.value[index])).collect();
        let cells = cells.into_iter().filter(|(from, to, _)| to > from).collect();
        Self { cells, at: 0 }
    }

    /// The readings between two travels, in ascending order of calls.
    fn read(&mut self, from: f64, to: f64, settings: &Settings) -> Reading {
        while self.at + 1 < self.cells.len() && self.cells[self.at].1 <= from {
            self.at += 1;
        }
        let (mut sum, mut first, mut second, mut error) = (0.0, 0.0, 0.0, 0.0);
        for (begin, end, reading) in &self.cells[self.at..] {
            if *begin >= to {
                break;
            }
            let weight = end.min(to) - begin.max(from);
            if weight <= 0.0 {
                continue;
            }
            sum += weight;
            first += weight * reading;
            second += weight * reading * reading;
            // Half a cell's error is the other half's too: counted so, the blocks' sum is right.
            error += weight * (end - begin);
        }
        if sum <= 0.0 {
            let mean = self.cells.get(self.at).map_or(0.0, |(_, _, reading)| *reading);
            return Reading { mean, spread: 0.0, variance_factor: 1.0 };
        }
        let mean = first / sum;
        let noise = settings.noise.steering * settings.noise.steering;
        let variance = second / sum - mean * mean - noise;
        let spread = if variance > 3.0 * noise { variance.sqrt() } else { 0.0 };
        Reading { mean, spread, variance_factor: error / (sum * sum) }
    }
}
