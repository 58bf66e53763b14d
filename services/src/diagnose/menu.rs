//! Manoeuvres from which the next one is chosen: each is short, shows something that the others do not, and keeps
//! within what the vehicle is said to be able to.

use kerbside_diagnosis::Manoeuvre;
use kerbside_geometry::{Vehicle, math};
use kerbside_simulation::Command;

/// Standing before each, so that sensors and start can be read \[s\].
const STILL: f64 = 2.0;
/// Between two commands of a curve \[s\].
const TICK: f64 = 0.05;
/// Shares of the limits that are driven: what is clipped shows nothing of what is asked.
const FAST: f64 = 0.8;
const SLOW: f64 = 0.35;
const WIDE: f64 = 0.8;
const NARROW: f64 = 0.4;
/// Nearly all of a limit, in curves where the side force stays below this acceleration \[m/s^2\]: what grows with the square of
/// the speed shows there.
const TOP: f64 = 0.95;
const SIDE: f64 = 4.0;

/// A stretch: how long it lasts \[s\], and speed and steering as shares of the limits.
type Stretch = (f64, f64, f64);

/// Every manoeuvre, scaled to `vehicle`.
pub fn of(vehicle: &Vehicle) -> Vec<Manoeuvre> {
    // The time in which the vehicle drives its own wheelbase: short for a model car, a second for a full-size one.
    let beat = vehicle.wheelbase / (FAST * vehicle.limits.speed);
    let drive = (4.0 * beat).max(4.0);
    let step = (1.2 * beat).max(1.5);
    let driven = |name: &str, stretches: &[Stretch]| stretched(vehicle, name, stretches);
    let mut menu = vec![
        driven("standing still", &[(8.0, 0.0, 0.0)]),
        driven(
            "straight, there and back",
            &[(drive, FAST, 0.0), (1.5, 0.0, 0.0), (drive, -FAST, 0.0)],
        ),
        driven(
            "straight at a crawl and fast",
            &[(drive, 0.1, 0.0), (drive, SLOW, 0.0), (drive, FAST, 0.0)],
        ),
        driven(
            "left circle at two speeds",
            &[(1.5 * drive, SLOW, WIDE), (1.5 * drive, FAST, WIDE)],
        ),
        driven(
            "right circle at two speeds",
            &[(1.5 * drive, SLOW, -WIDE), (1.5 * drive, FAST, -WIDE)],
        ),
        driven("circle at two angles", &[(1.5 * drive, FAST, NARROW), (1.5 * drive, FAST, WIDE)]),
        driven("eight", &[(2.0 * drive, FAST, WIDE), (2.0 * drive, FAST, -WIDE)]),
        driven(
            "arc, there and back",
            &[(drive, FAST, WIDE), (1.5, 0.0, WIDE), (drive, -FAST, WIDE)],
        ),
        driven("steps of the steering, large and small", &steering_steps(step)),
        driven(
            "steps of the speed, large and small",
            &[
                (step, FAST, 0.0),
                (step, SLOW, 0.0),
                (step, SLOW + 0.1, 0.0),
                (step, FAST, 0.0),
                (step, 0.0, 0.0),
                (step, -FAST, 0.0),
            ],
        ),
        driven(
            "starts and stops",
            &[
                (step, FAST, 0.0),
                (step, 0.0, 0.0),
                (step, FAST, 0.0),
                (step, 0.0, 0.0),
                (step, -FAST, 0.0),
            ],
        ),
        slalom(vehicle, "slalom", WIDE, drive),
        slalom(vehicle, "slalom of small angles", 0.15, drive),
        driven(
            "reversing in an S",
            &[(drive, -SLOW, WIDE), (drive, -SLOW, -WIDE), (0.5 * drive, -SLOW, 0.0)],
        ),
    ];
    menu.extend(fast_circle(vehicle, drive));
    menu
}

/// Large and small steps of the steering, each for `step` \[s\].
fn steering_steps(step: f64) -> [Stretch; 6] {
    [WIDE, -WIDE, NARROW, 0.1, -0.1, 0.0].map(|angle| (step, SLOW, angle))
}

/// A circle at two angles nearly at top speed, and slowly; none where the side force would be too large.
fn fast_circle(vehicle: &Vehicle, drive: f64) -> Option<Manoeuvre> {
    let curvature = math::tan(TOP * vehicle.limits.steering) / vehicle.wheelbase;
    let angles = [(drive, TOP, NARROW), (drive, TOP, TOP), (drive, SLOW, TOP)];
    ((TOP * vehicle.limits.speed).powi(2) * curvature <= SIDE)
        .then(|| stretched(vehicle, "circle at two angles, at top speed", &angles))
}

fn command(vehicle: &Vehicle, t: f64, speed: f64, steering: f64) -> Command {
    // To the microradian and the micrometre per second: a file shows no more.
    let rounded = |value: f64| (value * 1e6).round() * 1e-6;
    Command {
        t: rounded(t),
        speed: rounded(speed * vehicle.limits.speed),
        steering: rounded(steering * vehicle.limits.steering),
    }
}

/// Stretches after a stand, and a stand after them.
fn stretched(vehicle: &Vehicle, name: &str, stretches: &[Stretch]) -> Manoeuvre {
    let mut commands =
        vec![command(vehicle, 0.0, 0.0, stretches.first().map_or(0.0, |first| first.2))];
    let mut t = STILL;
    for (lasts, speed, steering) in stretches {
        commands.push(command(vehicle, t, *speed, *steering));
        t += lasts;
    }
    stand(vehicle, &mut commands, t);
    Manoeuvre { name: name.to_owned(), commands }
}

/// Weaving at two frequencies, one after the other.
fn slalom(vehicle: &Vehicle, name: &str, width: f64, lasts: f64) -> Manoeuvre {
    let mut commands = vec![command(vehicle, 0.0, 0.0, 0.0)];
    let mut t = STILL;
    for waves in [1.5, 3.0] {
        let begin = t;
        while t - begin < lasts {
            let phase = core::f64::consts::TAU * waves * (t - begin) / lasts;
            commands.push(command(vehicle, t, FAST, width * math::sin(phase)));
            t += TICK;
        }
    }
    stand(vehicle, &mut commands, t);
    Manoeuvre { name: name.to_owned(), commands }
}

/// Stops, and stays long enough to be seen standing.
fn stand(vehicle: &Vehicle, commands: &mut Vec<Command>, t: f64) {
    let steering = commands.last().map_or(0.0, |last| last.steering / vehicle.limits.steering);
    commands.push(command(vehicle, t, 0.0, steering));
    commands.push(command(vehicle, t + STILL, 0.0, steering));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vehicles() -> [Vehicle; 2] {
        let mut large = Vehicle::paper_car();
        large.wheelbase = 2.8;
        large.limits.speed = 10.0;
        [Vehicle::paper_car(), large]
    }

    #[test]
    fn every_manoeuvre_is_within_the_limits_and_ends_standing() {
        for vehicle in vehicles() {
            for Manoeuvre { name, commands } in of(&vehicle) {
                let within = |command: &Command| {
                    command.speed.abs() <= vehicle.limits.speed
                        && command.steering.abs() <= vehicle.limits.steering
                };
                assert!(commands.iter().all(within), "{name}");
                assert!(commands.windows(2).all(|pair| pair[0].t < pair[1].t), "{name}");
                let (first, last) = (commands[0], commands[commands.len() - 1]);
                assert_eq!((first.t, first.speed, last.speed), (0.0, 0.0, 0.0), "{name}");
                assert!((8.0..60.0).contains(&last.t), "{name} lasts {} s", last.t);
            }
        }
    }

    #[test]
    fn no_two_are_the_same() {
        let menu = of(&Vehicle::paper_car());
        assert!(menu.len() >= 10, "{}", menu.len());
        for (index, one) in menu.iter().enumerate() {
            let others = &menu[index + 1..];
            assert!(
                others.iter().all(|other| other.name != one.name && other.commands != one.commands)
            );
        }
    }
}
