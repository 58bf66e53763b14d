//! A set of cases to be judged on.

use super::dice::Dice;
use super::specification::Kind;
use super::{Case, Request};
use crate::insertions::{LISTED, UNLISTED};

/// Of a hundred cases so many have one listed effect, two, or none; the others have an unlisted one.
const SINGLES: usize = 40;
const PAIRS: usize = 18;
const NULLS: usize = 20;
/// Ends of small, medium and large, as shares of an effect's range.
const SIZES: [(f64, f64); 3] = [(0.05, 0.12), (0.12, 0.3), (0.3, 0.7)];
/// Vehicles that are tried until one shows an effect.
const TRIES: usize = 200;

/// `count` cases in an order of chance: seed and request of each. Every listed effect comes about equally often, small,
/// medium and large, and so does every unlisted one. `make` may change the request: duration, number of runs.
#[must_use]
pub fn series(seed: u64, count: usize, make: impl Fn(Request) -> Request) -> Vec<(u64, Request)> {
    let mut dice = Dice::new(seed, 0);
    // Chance says which effects come first, so that a short series is not the beginning of the list.
    let listed = dice.several(LISTED, LISTED.len());
    let unlisted = dice.several(UNLISTED, UNLISTED.len());
    let mut wanted = Vec::new();
    for number in 0..count {
        let kind = kind_of(number);
        let before = (0..number).filter(|earlier| kind_of(*earlier) == kind).count();
        let mut request = make(Request::new(kind));
        let table = match kind {
            Kind::Single | Kind::Pair => &listed,
            Kind::Unknown => &unlisted,
            Kind::Null => &Vec::new(),
        };
        request.ids.extend(table.get(before % table.len().max(1)).map(|known| known.id));
        if kind == Kind::Single {
            // Sizes go round once more with each round of the effects.
            let (low, high) = SIZES[(before + before / table.len().max(1)) % SIZES.len()];
            request.share = Some(dice.log_between(low, high));
        }
        wanted.push(request);
    }
    let order = dice.several(&(0..count).collect::<Vec<_>>(), count);
    let ordered = order.into_iter().filter_map(|at| wanted.get(at));
    ordered.filter_map(|request| seeded(&mut dice, request)).collect()
}

/// The kind of case `number`, mixed so that any beginning of the series has about the shares of the whole.
fn kind_of(number: usize) -> Kind {
    // 37 and 100 have no common divisor: a hundred numbers meet a hundred places.
    let place = number * 37 % 100;
    match place {
        _ if place < SINGLES => Kind::Single,
        _ if place < SINGLES + PAIRS => Kind::Pair,
        _ if place < SINGLES + PAIRS + NULLS => Kind::Null,
        _ => Kind::Unknown,
    }
}

/// A seed whose vehicle shows what is requested.
fn seeded(dice: &mut Dice, request: &Request) -> Option<(u64, Request)> {
    let fits = |seed: &u64| Case::of(*seed, request).is_some();
    let seeds: Vec<u64> = (0..TRIES).map(|_| dice.seed()).collect();
    seeds.into_iter().find(fits).map(|seed| (seed, request.clone()))
}
