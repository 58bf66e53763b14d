//! Kinds of drives, by what was driven and not by what a person called it.

use crate::condense::Condensed;
use crate::noise::Settings;
use crate::parameters::{Parameter, Parameters};
use crate::rows::{Rows, Used};

/// Turn per wheelbase rolled below which a drive is a straight one \[rad\].
const STRAIGHT: f64 = 0.05;
/// Share of all its turning that a drive has to one side, at least, to be one of that side.
const ONE_SIDED: f64 = 0.8;

/// What a drive is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Straight,
    Left,
    Right,
    Mixed,
}

/// The number of each run's kind, from 0 without gaps. Runs that turn to both sides are each a kind of their own: what
/// they have in common is not known.
pub(crate) fn kinds(
    runs: &[&Condensed],
    parameters: &Parameters,
    settings: &Settings,
) -> Vec<usize> {
    let mut seen: Vec<Kind> = Vec::new();
    let mut numbers = Vec::new();
    for run in runs {
        let kind = kind(run, parameters, settings);
        let known = seen.iter().position(|other| *other == kind && kind != Kind::Mixed);
        numbers.push(known.unwrap_or(seen.len()));
        if known.is_none() {
            seen.push(kind);
        }
    }
    numbers
}

fn kind(run: &Condensed, parameters: &Parameters, settings: &Settings) -> Kind {
    let used = Used::of(run);
    let (mut net, mut all, mut way) = (0.0, 0.0_f64, 0.0);
    for block in &run.blocks {
        let rows = Rows::of_block(block, parameters, &settings.noise, used);
        let Some(motion) = rows.motion() else { continue };
        // A circle to the left is one in reverse, too.
        let turn = block.direction * motion.turn;
        net += turn;
        all += turn.abs();
        way += motion.distance.abs();
    }
    if net.abs() * parameters.get(Parameter::Wheelbase) < STRAIGHT * way {
        // The noise of a block turns it, too: a slalom is told by what it turns beyond its net turn.
        let turns = all * parameters.get(Parameter::Wheelbase) > 2.0 * STRAIGHT * way;
        return if turns { Kind::Mixed } else { Kind::Straight };
    }
    match (net.abs() >= ONE_SIDED * all, net > 0.0) {
        (false, _) => Kind::Mixed,
        (true, true) => Kind::Left,
        (true, false) => Kind::Right,
    }
}
