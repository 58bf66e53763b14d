//! Row 8: wheels that spin.

use kerbside_geometry::Wheel;
use kerbside_proving_ground::{Manoeuvre, Pace, Physics, Sensors, Slip};

use crate::belief::{Knowledge, trial};
use crate::calibrations::Told;
use crate::ends::SPEEDS;
use crate::error::ReproductionError;
use crate::figure::{Accept, Figure};
use crate::follower::Contender;
use crate::progress::Progress;
use crate::scatter::{Course, Spread, Trial, drive, scatter};
use crate::statistics::{all, bootstrap, mean, mean_distance, share};

/// Who follows where parameters are known; else rear and fused alone.
const CONTENDERS: [Contender; 4] =
    [Contender::Rear, Contender::Front, Contender::Paper, Contender::Fused];
const PAIR: [Contender; 2] = [Contender::Rear, Contender::Fused];
/// Where along the drive's time a slip begins, and how long it lasts \[s\].
const PLACE: f64 = 0.4;
const LASTS: f64 = 0.3;

/// A kind of slip.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Kind {
    name: &'static str,
    /// Travel of a wheel, which, and on how many of its axle \[m\].
    travel: f64,
    wheel: Wheel,
    both: bool,
}

const fn kind(name: &'static str, travel: f64, wheel: Wheel, both: bool) -> Kind {
    Kind { name, travel, wheel, both }
}

/// What row 8 asks, and beyond it a smaller spin of both wheels, and a skid of a front wheel.
const KINDS: [Kind; 7] = [
    kind("none", 0.0, Wheel::RearLeft, false),
    kind("rl 5 mm", 0.005, Wheel::RearLeft, false),
    kind("rl 10 mm", 0.010, Wheel::RearLeft, false),
    kind("rl 30 mm", 0.030, Wheel::RearLeft, false),
    kind("both rear 30 mm", 0.030, Wheel::RearLeft, true),
    kind("both rear 10 mm", 0.010, Wheel::RearLeft, true),
    kind("fl skids 10 mm", -0.010, Wheel::FrontLeft, false),
];

impl Kind {
    fn slips(&self, begin: f64) -> Vec<Slip> {
        if self.travel == 0.0 {
            return Vec::new();
        }
        if self.both {
            return vec![Slip::rear_spin(self.travel, begin, LASTS)];
        }
        vec![Slip::spin(self.wheel, self.travel, begin, LASTS)]
    }
}

/// Drives of the S path with one kind of slip.
#[derive(Clone, Debug, PartialEq)]
pub struct Slipped {
    /// The slip, for people.
    pub name: &'static str,
    /// Top speed \[m/s\].
    pub speed: f64,
    /// What is known of the vehicle, for people.
    pub knowledge: &'static str,
    /// Per contender.
    pub spreads: Vec<Spread>,
    number: usize,
    physical: bool,
}

/// What is true and believed in a trial, by its seed.
type Trials<'a> = &'a dyn Fn(u64) -> Trial;

/// A setting in which all kinds of slip are driven.
struct Setting<'a> {
    speed: f64,
    knowledge: &'static str,
    physics: Physics,
    trials: Trials<'a>,
    case: u64,
    contenders: &'a [Contender],
}

/// Drives every kind of slip, parameters known and with residual errors, and with physics on where `physical` says what
/// was calibrated there.
pub(crate) fn drive_all(
    trials: usize,
    seed: u64,
    physical: &Told,
    progress: &mut Progress<'_>,
) -> Result<Vec<Slipped>, ReproductionError> {
    let sensors = Sensors::paper(1.0);
    let mut lines = Vec::new();
    for (index, speed) in SPEEDS.into_iter().enumerate() {
        for knowledge in [Knowledge::Known, Knowledge::Residual] {
            let trial_of = |seed: u64| trial(knowledge, &sensors, seed);
            let setting = Setting {
                speed,
                knowledge: knowledge.name(),
                physics: Physics::NEUTRAL,
                trials: &trial_of,
                case: 300 + index as u64,
                contenders: if knowledge == Knowledge::Known { &CONTENDERS } else { &PAIR },
            };
            drive_setting(&setting, &sensors, (trials, seed), &mut lines, progress)?;
        }
    }
    let trial_of = |seed: u64| physical.trial(seed);
    let setting = Setting {
        speed: SPEEDS[0],
        knowledge: "physics, calibrated",
        physics: Physics::ordinary(),
        trials: &trial_of,
        case: 310,
        contenders: &PAIR,
    };
    drive_setting(&setting, &sensors, (trials, seed), &mut lines, progress)?;
    Ok(lines)
}

fn drive_setting(
    setting: &Setting<'_>,
    sensors: &Sensors,
    (trials, seed): (usize, u64),
    lines: &mut Vec<Slipped>,
    progress: &mut Progress<'_>,
) -> Result<(), ReproductionError> {
    let manoeuvre = Manoeuvre::s_path(Pace::paper(setting.speed));
    let begin = PLACE * manoeuvre.duration();
    let test = drive(setting.physics, sensors, manoeuvre);
    let driven = test.driven();
    for (number, kind) in KINDS.into_iter().enumerate() {
        let slips = kind.slips(begin);
        // The same noise with every slip: what a slip costs is compared in pairs.
        let seed = (seed, setting.case);
        let course =
            Course { driven: &driven, sensors, slips: &slips, stations: &[], seed, trials };
        lines.push(Slipped {
            name: kind.name,
            speed: setting.speed,
            knowledge: setting.knowledge,
            spreads: scatter(&course, setting.contenders, setting.trials, progress)?,
            number,
            physical: setting.physics != Physics::NEUTRAL,
        });
    }
    Ok(())
}

/// How many slips there are of each setting.
pub(crate) const PER_SETTING: usize = KINDS.len();
/// How many settings there are.
pub(crate) const SETTINGS: usize = 2 * SPEEDS.len() + 1;

impl Slipped {
    /// The errors of one contender.
    #[must_use]
    pub fn of(&self, contender: Contender) -> Option<&Spread> {
        self.spreads.iter().find(|spread| spread.contender == contender)
    }

    /// Whether the true wheel or axle is at the rear.
    #[must_use]
    pub fn at_rear(&self) -> bool {
        !KINDS[self.number].wheel.is_front()
    }

    fn place(&self) -> String {
        format!("{}, {:.0} mm/s, {}", self.name, 1e3 * self.speed, self.knowledge)
    }

    /// Mean end error of fused over that of `clean`, and its paired interval.
    #[must_use]
    pub fn cost(&self, clean: &Self) -> (f64, (f64, f64)) {
        let of = |line: &Self| line.of(Contender::Fused).map_or(Vec::new(), |s| s.end().to_vec());
        let (slipped, clean) = (of(self), of(clean));
        let distance = |errors: &[[f64; 3]], indices: &[usize]| {
            let picked: Vec<_> = indices.iter().map(|index| errors[*index]).collect();
            mean_distance(&picked)
        };
        let ratio = |indices: &[usize]| distance(&slipped, indices) / distance(&clean, indices);
        (ratio(&all(slipped.len())), bootstrap(slipped.len(), 8, ratio))
    }

    fn figures(&self, clean: &Self) -> Vec<Figure> {
        let Some(fused) = self.of(Contender::Fused) else { return Vec::new() };
        let trials = fused.flagged.len();
        let (flags, interval) = share(fused.flags(), trials);
        if self.number == 0 {
            let name = format!("false flags, {}", self.place());
            let accept = Accept::AtMost(0.02);
            return vec![Figure::new(8, name, "", flags, accept).between(interval)];
        }
        let held = (1..=4).contains(&self.number);
        let one = (1..=3).contains(&self.number);
        let only = |held: bool, accept: Accept| if held { accept } else { Accept::Shown };
        let found = Figure::new(
            8,
            format!("found, {}", self.place()),
            "",
            flags,
            only(one, Accept::AtLeast(0.99)),
        );
        let (cost, between) = self.cost(clean);
        let cost = Figure::new(
            8,
            format!("mean error over no slip, {}", self.place()),
            "",
            cost,
            only(held, Accept::AtMost(1.15)),
        );
        let axle = usize::from(self.at_rear());
        let named = fused.flagged.iter().filter(|axles| axles[axle] && !axles[1 - axle]).count();
        let (named, third) = share(named, fused.flags().max(1));
        let named =
            Figure::new(8, format!("right axle named, {}", self.place()), "", named, Accept::Shown);
        vec![found.between(interval), cost.between(between), named.between(third)]
    }

    /// Whether physics were on.
    #[must_use]
    pub fn is_physical(&self) -> bool {
        self.physical
    }

    /// Mean end error of a contender \[m\].
    #[must_use]
    pub fn mean_error(&self, contender: Contender) -> f64 {
        let end = |spread: &Spread| mean_distance(spread.end());
        self.of(contender).map_or(f64::NAN, end)
    }

    /// Mean over the drives of what the sensors disagree on; 1 where they err as believed.
    #[must_use]
    pub fn disagreement(&self) -> f64 {
        self.of(Contender::Fused).map_or(f64::NAN, |s| mean(s.disagreement.iter().copied()))
    }
}

/// The figures of row 8.
pub(crate) fn figures(lines: &[Slipped]) -> Vec<Figure> {
    let settings = lines.chunks(PER_SETTING);
    settings.flat_map(|setting| setting.iter().flat_map(|line| line.figures(&setting[0]))).collect()
}
