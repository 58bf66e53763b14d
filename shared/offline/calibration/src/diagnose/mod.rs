//! Bad input, recognised by evidence in the data and named: never silently fitted.

mod axles;
mod clock;
mod grid;
mod reference;
mod samples;
mod turning;
mod wheels;

use kerbside_geometry::{Vehicle, Wheel};

use crate::measured::{Kind, kind, turn};
use crate::noise::Noise;
use crate::parameters::Parameters;
use crate::run::Run;
use grid::Grid;

/// What may be wrong with a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Problem {
    /// A reading is not a finite number.
    NotANumber,
    /// Stamps that do not increase, or fewer readings than stamps.
    Stamps,
    /// A wheel's count jumps farther than the vehicle can roll: a wrap, a reset, or readings that were lost.
    Jump(Wheel),
    /// The vehicle hardly moves.
    TooShort,
    /// An arc by name that does not turn, or a case without any turn.
    NoTurning,
    /// A wheel's count stands still while the others roll.
    StuckWheel(Wheel),
    /// A wheel counts backwards.
    ReversedWheel(Wheel),
    /// Some wheels count backwards, and which of them is not to be told.
    ContraryWheels,
    /// A wheel rolls a multiple of what the others roll: counts per turn, or its radius.
    WheelScale(Wheel),
    /// Left and right wheel of the front (true) or rear axle are exchanged.
    SwappedSides {
        /// Of the front axle.
        front: bool,
    },
    /// Front and rear axle are exchanged.
    SwappedAxles,
    /// The steering sensor's sign is reversed.
    ReversedSteering,
    /// The steering sensor reads more than any road wheel turns: degrees.
    SteeringUnit,
    /// The gyro's sign is reversed.
    ReversedGyro,
    /// The reference's frame is left-handed.
    MirroredReference,
    /// The reference's heading grows the other way than its positions turn.
    ReversedYaw,
    /// The sources disagree on the side to which the vehicle turns, and which is wrong is not to be told.
    ContraryTurns,
    /// The reference's heading is turned against its positions.
    TurnedYaw,
    /// The reference's heading is in degrees.
    YawUnit,
    /// The reference's positions are in another unit.
    PositionUnit,
    /// The reference's stamps are from another clock.
    OtherClock,
    /// The heading of an arc is too uncertain for the closed form.
    CoarseHeading,
}

/// Something found in a run, or in the case as a whole.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The run; none where it is about all of them.
    pub run: Option<String>,
    /// What it is.
    pub problem: Problem,
    /// The evidence, in words and numbers.
    pub evidence: String,
    /// Whether the run must not be fitted.
    pub forbids: bool,
}

impl core::fmt::Display for Finding {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}: {}", self.problem, self.evidence)
    }
}

impl core::fmt::Display for Problem {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let axle = |front: bool| if front { "front" } else { "rear" };
        match self {
            Self::NotANumber => write!(f, "a reading is not a number"),
            Self::Stamps => write!(f, "stamps do not increase"),
            Self::Jump(wheel) => write!(f, "the count of wheel {} jumps", wheel.name()),
            Self::TooShort => write!(f, "too short"),
            Self::NoTurning => write!(f, "no turning"),
            Self::StuckWheel(wheel) => write!(f, "wheel {} is stuck", wheel.name()),
            Self::ReversedWheel(wheel) => write!(f, "wheel {} counts backwards", wheel.name()),
            Self::ContraryWheels => write!(f, "wheels count in contrary directions"),
            Self::WheelScale(wheel) => {
                write!(f, "wheel {} rolls a multiple of the others", wheel.name())
            }
            Self::SwappedSides { front } => {
                write!(f, "left and right wheel of the {} axle are exchanged", axle(*front))
            }
            Self::SwappedAxles => write!(f, "front and rear axle are exchanged"),
            Self::ReversedSteering => write!(f, "the steering sensor's sign is reversed"),
            Self::SteeringUnit => write!(f, "the steering sensor's unit is not the radian"),
            Self::ReversedGyro => write!(f, "the gyro's sign is reversed"),
            Self::MirroredReference => write!(f, "the reference's frame is mirrored"),
            Self::ReversedYaw => write!(f, "the reference's heading has the wrong sign"),
            Self::ContraryTurns => write!(f, "sources turn to contrary sides"),
            Self::TurnedYaw => write!(f, "the reference's heading is turned against its positions"),
            Self::YawUnit => write!(f, "the reference's heading is not in radians"),
            Self::PositionUnit => write!(f, "the reference's positions are not in metres"),
            Self::OtherClock => write!(f, "the reference's stamps are of another clock"),
            Self::CoarseHeading => write!(f, "heading too coarse for the closed form"),
        }
    }
}

/// Collects the findings of one run.
pub(crate) struct Findings<'a> {
    run: &'a Run,
    list: Vec<Finding>,
}

impl Findings<'_> {
    /// Notes a problem that forbids the run.
    fn forbid(&mut self, problem: Problem, evidence: String) {
        self.add(problem, evidence, true);
    }

    fn add(&mut self, problem: Problem, evidence: String, forbids: bool) {
        let run = Some(self.run.name.clone());
        self.list.push(Finding { run, problem, evidence, forbids });
    }
}

/// What is wrong with `runs` of `vehicle`, run by run in their order, what concerns all of them last.
#[must_use]
pub fn diagnose_runs(runs: &[Run], vehicle: &Vehicle, noise: &Noise) -> Vec<Finding> {
    let mut list = Vec::new();
    let mut turning = Vec::new();
    for run in runs {
        let mut found = Findings { run, list: Vec::new() };
        if let Some(turns) = diagnose_run(&mut found, run, vehicle, noise) {
            turning.push((run.name.clone(), turns));
        }
        list.extend(found.list);
    }
    axles::swapped_axles(runs, vehicle, &mut list);
    same_wiring(&turning, &mut list);
    if turning.iter().all(|(_, turns)| !turns) && !turning.is_empty() {
        list.push(Finding {
            run: None,
            problem: Problem::NoTurning,
            evidence:
                "no run turns by 40 degrees or more: tracks and wheelbase cannot be identified"
                    .to_owned(),
            forbids: false,
        });
    }
    list
}

/// Whether the run turns; none where it is too bad to say.
fn diagnose_run(found: &mut Findings, run: &Run, vehicle: &Vehicle, noise: &Noise) -> Option<bool> {
    samples::check(found, run);
    if !found.list.is_empty() {
        return None;
    }
    wheels::check_jumps(found, run, vehicle, noise);
    if !found.list.is_empty() {
        return None;
    }
    let mut grid = Grid::new(run, vehicle)?;
    wheels::check(found, run, &mut grid, vehicle, noise);
    if !found.list.is_empty() {
        return None;
    }
    reference::check_units(found, run, &grid, vehicle, noise);
    if !found.list.is_empty() {
        return None;
    }
    let turned = turning::check(found, run, &grid, vehicle, noise);
    reference::check_frame(found, run, &grid, noise, vehicle);
    if found.list.is_empty() {
        clock::check(found, run, &grid, vehicle, noise);
        coarse_heading(found, run, vehicle, noise);
    }
    Some(turned > turning::TURNS)
}

fn coarse_heading(found: &mut Findings, run: &Run, vehicle: &Vehicle, noise: &Noise) {
    let nominal = Parameters::nominal(vehicle);
    if kind(run, vehicle, &nominal) != Kind::Arc {
        return;
    }
    let Some(turn) = turn(run, vehicle, &nominal, noise) else { return };
    let share = 100.0 * (turn.deviation / turn.value).abs();
    if share > 3.0 {
        let evidence = format!(
            "its turn of {:.0} degrees is known to {:.1} degrees, {share:.1} %; the closed form takes 3 % at most",
            kerbside_geometry::angle::degrees(turn.value),
            kerbside_geometry::angle::degrees(turn.deviation)
        );
        found.add(Problem::CoarseHeading, evidence, false);
    }
}

/// Wires do not change between runs: what every turning run shows holds for those that go straight, too.
fn same_wiring(turning: &[(String, bool)], list: &mut Vec<Finding>) {
    let wiring = [
        Problem::SwappedSides { front: true },
        Problem::SwappedSides { front: false },
        Problem::SwappedAxles,
        Problem::ReversedSteering,
    ];
    for problem in wiring {
        let accused = |name: &String| {
            list.iter().any(|found| found.problem == problem && found.run.as_ref() == Some(name))
        };
        let turned: Vec<&String> =
            turning.iter().filter(|(_, turns)| *turns).map(|(name, _)| name).collect();
        let all = !turned.is_empty() && turned.iter().all(|name| accused(name));
        if !all {
            continue;
        }
        let rest = turning.iter().map(|(name, _)| name).filter(|name| !accused(name));
        let rest: Vec<Finding> = rest
            .map(|name| Finding {
                run: Some(name.clone()),
                problem,
                evidence: format!("as every run that turns shows ({})", turned[0]),
                forbids: true,
            })
            .collect();
        list.extend(rest);
    }
}
