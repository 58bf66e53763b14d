//! What is driven.

use core::f64::consts::FRAC_PI_2;

use crate::actuators::{Command, Setpoint, at_rest, for_motion};
use crate::chassis::Chassis;
use crate::leg::{Leg, Section};
use crate::profile::{Pace, Trapezoid};

/// Standing before the first leg, between two legs and after the last one unless told otherwise \[s\].
pub const PAUSE: f64 = 0.5;

/// What is driven: a path from rest to rest, or commands given by time.
///
/// A path is a function of the distance that is meant to be covered, with the speed a trapezoid over time. In the
/// kinematic limit the vehicle covers it exactly; else nobody corrects where it ends up.
#[derive(Clone, Debug)]
pub struct Manoeuvre {
    course: Course,
}

#[derive(Clone, Debug)]
pub(crate) enum Course {
    Path(Path),
    Commands { rows: Vec<(f64, Command)>, duration: f64 },
}

/// Legs, with a rest before each and after the last.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    legs: Vec<(Leg, Trapezoid)>,
    pause: f64,
}

/// Where a path is at an instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Along {
    /// Number of the leg.
    pub leg: usize,
    /// Covered of that leg \[m\].
    pub distance: f64,
    /// Along the leg, not negative \[m/s\].
    pub speed: f64,
    /// \[m/s^2\].
    pub acceleration: f64,
}

impl Manoeuvre {
    /// A path of `legs`.
    #[must_use]
    pub fn path(legs: Vec<Leg>, pace: Pace) -> Self {
        let with_profile = |leg: Leg| {
            let profile = Trapezoid::new(leg.length(), &pace);
            (leg, profile)
        };
        let legs = legs.into_iter().map(with_profile).collect();
        Self { course: Course::Path(Path { legs, pause: PAUSE }) }
    }

    /// A straight of `distance` \[m\], in reverse where negative.
    #[must_use]
    pub fn straight(distance: f64, pace: Pace) -> Self {
        let section = Section::straight(distance.abs());
        Self::path(vec![Leg::new(distance >= 0.0, &[section], 0.0)], pace)
    }

    /// An arc of `radius` \[m\] about a centre on the left where positive, covering `angle` \[rad\], positive, of it,
    /// `forward` or in reverse; a full circle for 2 pi. The wheels are turned before the car moves.
    #[must_use]
    pub fn arc(radius: f64, angle: f64, forward: bool, pace: Pace) -> Self {
        Self::path(vec![Leg::new(forward, &[Section::arc(radius, angle)], 0.0)], pace)
    }

    /// The S path on which the paper's filter is judged: 1.0 m straight, 90 degrees left at 1.2 m, 0.5 m straight, 90
    /// degrees right, 0.5 m straight, with ramps of 0.15 m; 5.77 m. See docs/reproduction.md.
    #[must_use]
    pub fn s_path(pace: Pace) -> Self {
        let sections = [
            Section::straight(1.0),
            Section::arc(1.2, FRAC_PI_2),
            Section::straight(0.5),
            Section::arc(-1.2, FRAC_PI_2),
            Section::straight(0.5),
        ];
        Self::path(vec![Leg::new(true, &sections, 0.15)], pace)
    }

    /// `bends` arcs of `radius` and `angle` to alternate sides, the first one and the last one half as long, so that the
    /// course swings about a line; with ramps of `ramp` \[m\].
    #[must_use]
    pub fn slalom(radius: f64, angle: f64, bends: usize, ramp: f64, pace: Pace) -> Self {
        let bend = |k: usize| {
            let share = if k == 0 || k + 1 == bends { 0.5 } else { 1.0 };
            Section::arc(if k.is_multiple_of(2) { radius } else { -radius }, share * angle)
        };
        let mut sections = vec![Section::straight(ramp)];
        sections.extend((0..bends).map(bend));
        sections.push(Section::straight(ramp));
        Self::path(vec![Leg::new(true, &sections, ramp)], pace)
    }

    /// `rounds` times forward and back again over `distance` \[m\] with this `curvature` \[1/m\].
    #[must_use]
    pub fn shuttle(distance: f64, curvature: f64, rounds: usize, pace: Pace) -> Self {
        let section = Section { length: distance, curvature };
        let leg = |k: usize| Leg::new(k.is_multiple_of(2), &[section], 0.0);
        Self::path((0..2 * rounds).map(leg).collect(), pace)
    }

    /// Commands by time \[s\], in the order of their times, each holding until the next; standing before the first one.
    /// The drive ends at `duration` \[s\].
    #[must_use]
    pub fn commands(rows: Vec<(f64, Command)>, duration: f64) -> Self {
        Self { course: Course::Commands { rows, duration } }
    }

    /// The same path with rests of `pause` \[s\] before each leg and after the last.
    #[must_use]
    pub fn with_pause(mut self, pause: f64) -> Self {
        if let Course::Path(path) = &mut self.course {
            path.pause = pause;
        }
        self
    }

    /// Duration \[s\].
    #[must_use]
    pub fn duration(&self) -> f64 {
        match &self.course {
            Course::Path(path) => path.duration(),
            Course::Commands { duration, .. } => *duration,
        }
    }

    /// Length of the path in both directions \[m\]; none of commands.
    #[must_use]
    pub fn length(&self) -> Option<f64> {
        match &self.course {
            Course::Path(path) => Some(path.legs.iter().map(|(leg, _)| leg.length()).sum()),
            Course::Commands { .. } => None,
        }
    }

    /// The command at `time` \[s\] for a vehicle of these measures.
    #[must_use]
    pub fn command(&self, chassis: &Chassis, time: f64) -> Command {
        self.setpoint(chassis, time).command
    }

    pub(crate) fn course(&self) -> &Course {
        &self.course
    }

    pub(crate) fn setpoint(&self, chassis: &Chassis, time: f64) -> Setpoint {
        match &self.course {
            Course::Path(path) => path.setpoint(chassis, time),
            Course::Commands { rows, .. } => {
                let behind = rows.partition_point(|row| row.0 <= time);
                let newest = behind.checked_sub(1).and_then(|at| rows.get(at));
                newest.map_or(at_rest(0.0), |row| Setpoint::held(row.1))
            }
        }
    }

    /// Instants at which the setpoint has a kink \[s\], in order.
    pub(crate) fn kinks(&self) -> Vec<f64> {
        match &self.course {
            Course::Path(path) => path.kinks(),
            Course::Commands { rows, .. } => rows.iter().map(|row| row.0).collect(),
        }
    }
}

impl Path {
    /// Leg `number`; none behind the last.
    pub(crate) fn leg(&self, number: usize) -> Option<&Leg> {
        self.legs.get(number).map(|(leg, _)| leg)
    }

    fn duration(&self) -> f64 {
        self.legs.iter().map(|(_, profile)| profile.duration() + self.pause).sum::<f64>()
            + self.pause
    }

    /// When each leg begins to roll \[s\].
    fn begins(&self) -> impl Iterator<Item = f64> + '_ {
        self.legs.iter().scan(self.pause, |next, (_, profile)| {
            let begin = *next;
            *next += profile.duration() + self.pause;
            Some(begin)
        })
    }

    /// Where the path is at `time` \[s\]. A rest belongs to the leg behind it, the last one to the last leg.
    pub(crate) fn at(&self, time: f64) -> Along {
        let mut along = Along { leg: 0, distance: 0.0, speed: 0.0, acceleration: 0.0 };
        for ((number, (_, profile)), begin) in self.legs.iter().enumerate().zip(self.begins()) {
            if number > 0 && time < begin - self.pause {
                break;
            }
            let [distance, speed, acceleration] = profile.at(time - begin);
            along = Along { leg: number, distance, speed, acceleration };
        }
        along
    }

    fn setpoint(&self, chassis: &Chassis, time: f64) -> Setpoint {
        let along = self.at(time);
        let Some(leg) = self.leg(along.leg) else {
            return at_rest(0.0);
        };
        let (curvature, slope) = leg.curvature(along.distance);
        let direction = leg.direction();
        let (speed, acceleration) = (direction * along.speed, direction * along.acceleration);
        for_motion(chassis, speed, acceleration, curvature, slope * along.speed)
    }

    fn kinks(&self) -> Vec<f64> {
        let of_leg = |((leg, profile), begin): (&(Leg, Trapezoid), f64)| {
            let knots = leg.knots().map(|knot| profile.time_at(knot));
            let kinks = profile.kinks().into_iter().chain(knots).map(|at| begin + at);
            kinks.chain([begin]).collect::<Vec<_>>()
        };
        let mut kinks: Vec<_> = self.legs.iter().zip(self.begins()).flat_map(of_leg).collect();
        kinks.sort_by(f64::total_cmp);
        kinks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PACE: Pace = Pace { speed: 0.09, acceleration: 0.1 };

    #[test]
    fn the_s_path_is_as_long_as_it_is_said_to_be() {
        let manoeuvre = Manoeuvre::s_path(PACE);
        assert!((manoeuvre.length().unwrap() - 5.77).abs() < 1e-3);
        // 5.77 m at 0.09 m/s, one more ramp of 0.9 s, and two rests.
        assert!((manoeuvre.duration() - (5.77 / 0.09 + 0.9 + 1.0)).abs() < 0.02);
    }

    #[test]
    fn a_shuttle_comes_back_and_rests_between() {
        let manoeuvre = Manoeuvre::shuttle(0.5, 0.4, 2, PACE).with_pause(1.0);
        let Course::Path(path) = manoeuvre.course() else { panic!("a path") };
        let begins: Vec<_> = path.begins().collect();
        assert_eq!(begins.len(), 4);
        for (number, begin) in begins.into_iter().enumerate() {
            let resting = path.at(begin - 0.5);
            assert_eq!((resting.leg, resting.distance, resting.speed), (number, 0.0, 0.0));
            assert!(path.at(begin + 0.5).speed > 0.0);
        }
        let last = path.at(1e9);
        assert_eq!((last.leg, last.distance), (3, 0.5));
    }

    #[test]
    fn commands_hold_until_the_next() {
        let chassis = Chassis::paper();
        let command = |speed| Command { speed, steering: 0.1 };
        let manoeuvre = Manoeuvre::commands(vec![(1.0, command(0.1)), (2.0, command(0.2))], 3.0);
        assert_eq!(manoeuvre.command(&chassis, 0.5), Command::default());
        assert_eq!(manoeuvre.command(&chassis, 1.5), command(0.1));
        assert_eq!(manoeuvre.command(&chassis, 2.0), command(0.2));
    }
}
