//! A run, cut into blocks of a few centimetres: all that the fit needs of it, whatever the parameters.

use kerbside_geometry::{Pose, Vehicle};

use crate::cells::{Cells, Reading};
use crate::error::CalibrationError;
use crate::gyro::{Gyro, Turned};
use crate::known::{Known, is_agreed, known_of, looks_at};
use crate::noise::Settings;
use crate::parameters::Parameters;
use crate::run::Run;
use crate::travel::Base;

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

/// Variance of a turn of which nothing is known \[rad^2\].
const ANYHOW: f64 = 1.0;

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

fn rotation(run: &Run, from: f64, to: f64) -> [f64; 4] {
    core::array::from_fn(|wheel| {
        run.rotation[wheel].as_ref().map_or(0.0, |series| series.at(to) - series.at(from))
    })
}
