//! Every listed effect as something that can be fitted: coordinates, their priors and where a search begins.

use kerbside_geometry::{Vehicle, WHEELS, math};
use kerbside_simulation::effects::{Definition, ParameterDefinition, library};
use kerbside_simulation::{Effects, Parameter};

use crate::generic::Extent;

/// How a coordinate becomes parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Meaning {
    /// The parameter itself.
    Plain(Parameter),
    /// Logarithm of a limit over its nominal value, which it can only lower.
    Limit(Parameter, f64),
    /// Component of a floor's slope along x or y.
    Slope { across: bool },
}

/// One number of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Coordinate {
    meaning: Meaning,
    /// Value without effect.
    pub neutral: f64,
    /// Standard deviation of its prior about `centre`.
    pub deviation: f64,
    /// Where the prior is centred.
    pub centre: f64,
    /// Bounds.
    pub low: f64,
    /// See `low`.
    pub high: f64,
}

/// An effect to be fitted, for one wheel where it has one.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    pub definition: &'static Definition,
    /// Index of the wheel, of `count_loss`.
    pub wheel: Option<usize>,
    pub coordinates: Vec<Coordinate>,
    /// Points where a search may begin, besides those of the map.
    pub starts: Vec<Vec<f64>>,
}

/// Beyond the range of a sane search by this factor a fit is stopped.
const BEYOND: f64 = 1.6;

/// All candidates for a vehicle.
pub(crate) fn candidates(vehicle: &Vehicle, extent: &Extent) -> Vec<Candidate> {
    library().iter().flat_map(|definition| of(definition, vehicle, extent)).collect()
}

fn of(definition: &'static Definition, vehicle: &Vehicle, extent: &Extent) -> Vec<Candidate> {
    let one =
        |(coordinates, starts): Fitted| Candidate { definition, wheel: None, coordinates, starts };
    match definition.id {
        "acceleration_limit" => {
            limit(definition, vehicle, vehicle.limits.acceleration).map(one).into_iter().collect()
        }
        "steering_rate_limit" => {
            limit(definition, vehicle, vehicle.limits.steering_rate).map(one).into_iter().collect()
        }
        "floor_slope" => vec![one(slope(range(definition, "rate", vehicle).1))],
        "floor_patch" => patch(definition, vehicle, extent).map(one).into_iter().collect(),
        "count_loss" => (0..4)
            .filter_map(|wheel| {
                let high = range(definition, "fraction", vehicle).1;
                let coordinate =
                    one_sided(Parameter::find_at("count_loss", "fraction", WHEELS[wheel])?, high);
                let (coordinates, starts) = (vec![coordinate], vec![vec![0.1 * high]]);
                Some(Candidate { definition, wheel: Some(wheel), coordinates, starts })
            })
            .collect(),
        _ => vec![one(ordinary(definition, vehicle))],
    }
}

/// Coordinates and where a search begins.
type Fitted = (Vec<Coordinate>, Vec<Vec<f64>>);

/// What a sane search covers of a parameter.
fn range(definition: &Definition, name: &str, vehicle: &Vehicle) -> (f64, f64) {
    let parameter = definition.parameters.iter().find(|p| p.name == name);
    parameter.map_or((0.0, 1.0), |p| p.range_for(vehicle))
}

/// Logarithm of the largest share of a nominal limit that lowers it.
const HIGHEST: f64 = -1e-3;

/// A limit that lowers the nominal one.
fn limit(definition: &Definition, vehicle: &Vehicle, nominal: f64) -> Option<Fitted> {
    let low = math::ln(0.5 * range(definition, "limit", vehicle).0 / nominal);
    // A nominal limit below all that a search covers cannot be lowered.
    if low >= HIGHEST {
        return None;
    }
    let meaning = Meaning::Limit(Parameter::find(definition.id, "limit")?, nominal);
    let coordinate =
        Coordinate { meaning, neutral: 0.0, deviation: 1.0, centre: -0.8, low, high: HIGHEST };
    Some((vec![coordinate], vec![vec![-0.1], vec![-0.35], vec![-0.8], vec![-1.5]]))
}

/// A vector in the reference frame.
fn slope(high: f64) -> Fitted {
    let axis = |across| Coordinate {
        meaning: Meaning::Slope { across },
        neutral: 0.0,
        deviation: 0.5 * high,
        centre: 0.0,
        low: -BEYOND * high,
        high: BEYOND * high,
    };
    (vec![axis(false), axis(true)], vec![vec![0.0, 0.0]])
}

/// A disc; where a search begins comes from the map.
fn patch(definition: &Definition, vehicle: &Vehicle, extent: &Extent) -> Option<Fitted> {
    let find = |name: &str| Parameter::find(definition.id, name);
    let size = vehicle.wheelbase;
    let [x0, y0, x1, y1] = extent.place;
    let free = |parameter, low: f64, high: f64| Coordinate {
        meaning: Meaning::Plain(parameter),
        neutral: 0.0,
        deviation: (0.3 * (high - low)).max(size),
        centre: 0.5 * (low + high),
        low: low - 2.0 * size,
        high: high + 2.0 * size,
    };
    let radius = Coordinate {
        deviation: 2.0 * size,
        centre: size,
        low: 0.1 * size,
        high: 8.0 * size,
        ..free(find("radius")?, 0.0, size)
    };
    let ratio = one_sided(find("ratio")?, range(definition, "ratio", vehicle).1);
    Some((vec![free(find("x")?, x0, x1), free(find("y")?, y0, y1), radius, ratio], Vec::new()))
}

/// Every parameter as it is.
fn ordinary(definition: &Definition, vehicle: &Vehicle) -> Fitted {
    let coordinate = |p: &ParameterDefinition| {
        let (parameter, (low, high)) =
            (Parameter::find(definition.id, p.name)?, p.range_for(vehicle));
        Some(if low >= p.neutral {
            one_sided(parameter, high)
        } else {
            two_sided(parameter, p.neutral, low, high)
        })
    };
    let coordinates: Vec<Coordinate> =
        definition.parameters.iter().filter_map(coordinate).collect();
    let starts = starts(&coordinates);
    (coordinates, starts)
}

fn one_sided(parameter: Parameter, high: f64) -> Coordinate {
    Coordinate {
        meaning: Meaning::Plain(parameter),
        neutral: 0.0,
        deviation: 0.5 * high,
        centre: 0.0,
        low: 0.0,
        high: BEYOND * high,
    }
}

fn two_sided(parameter: Parameter, neutral: f64, low: f64, high: f64) -> Coordinate {
    Coordinate {
        meaning: Meaning::Plain(parameter),
        neutral,
        deviation: 0.25 * (high - low),
        centre: neutral,
        low: neutral + BEYOND * (low - neutral),
        high: neutral + BEYOND * (high - neutral),
    }
}

/// The neutral point; of a quantity that has one side only also points within, so that kinks at the neutral one do not
/// hold the search there.
fn starts(coordinates: &[Coordinate]) -> Vec<Vec<f64>> {
    let at = |share: f64| {
        let place = |c: &Coordinate| {
            if c.low >= c.neutral { c.neutral + share * c.high / BEYOND } else { c.neutral }
        };
        coordinates.iter().map(place).collect::<Vec<f64>>()
    };
    if coordinates.iter().any(|c| c.low >= c.neutral) {
        vec![at(0.05), at(0.25), at(0.6)]
    } else {
        vec![at(0.0)]
    }
}

impl Candidate {
    /// Puts the effect into `effects`.
    pub(crate) fn apply(&self, x: &[f64], effects: &mut Effects) {
        let mut slope = (0.0, 0.0);
        for (coordinate, value) in self.coordinates.iter().zip(x) {
            match coordinate.meaning {
                Meaning::Plain(parameter) => effects.set(parameter, *value),
                Meaning::Limit(parameter, nominal) => {
                    effects.set(parameter, nominal * math::exp(*value))
                }
                Meaning::Slope { across: false } => slope.0 = *value,
                Meaning::Slope { across: true } => slope.1 = *value,
            }
        }
        if self.definition.id == "floor_slope" {
            let values = [math::atan2(slope.1, slope.0), math::hypot(slope.0, slope.1)];
            for (name, value) in ["direction", "rate"].into_iter().zip(values) {
                if let Some(parameter) = Parameter::find("floor_slope", name) {
                    effects.set(parameter, value);
                }
            }
        }
    }

    /// The parameters, as the library names them, at `x`.
    pub(crate) fn parameters(&self, x: &[f64]) -> Vec<(&'static str, f64)> {
        if self.definition.id == "floor_slope" {
            return vec![("direction", math::atan2(x[1], x[0])), ("rate", math::hypot(x[0], x[1]))];
        }
        let names = self.definition.parameters.iter().map(|p| p.name);
        let values = self.coordinates.iter().zip(x).map(|(c, value)| match c.meaning {
            Meaning::Limit(_, nominal) => nominal * math::exp(*value),
            _ => *value,
        });
        names.zip(values).collect()
    }

    /// Whether every coordinate may leave its neutral value in both directions.
    pub(crate) fn is_two_sided(&self) -> bool {
        self.coordinates.iter().all(|c| c.low < c.neutral && c.neutral < c.high) && !self.is_patch()
    }

    /// Whether it is a limit that lowers another.
    pub(crate) fn is_limit(&self) -> bool {
        self.coordinates.iter().any(|c| matches!(c.meaning, Meaning::Limit(..)))
    }

    /// Whether its cost is a staircase: commands either pass it or do not.
    pub(crate) fn is_staircase(&self) -> bool {
        self.definition.id == "speed_dead_zone"
    }

    /// Parameters that a nuisance may share: the nuisance is left out while the effect is fitted.
    pub(crate) fn shares(&self, parameter: Parameter) -> bool {
        self.coordinates.iter().any(|c| matches!(c.meaning, Meaning::Plain(p) if p == parameter))
    }

    /// Step of the numerical slope of a coordinate.
    pub(crate) fn probe(&self, coordinate: usize, extent: &Extent) -> f64 {
        let c = &self.coordinates[coordinate];
        // A disc's edge meets the bins one by one: a small step would see none of them.
        if self.is_patch() && coordinate < 3 { 0.1 * extent.wheelbase } else { 0.02 * c.deviation }
    }

    /// Whether it is a place on the floor, which is sought on the map.
    pub(crate) fn is_patch(&self) -> bool {
        self.definition.id == "floor_patch"
    }

    /// Where to begin; nothing for one that is sought on the map.
    pub(crate) fn begins(&self) -> &[Vec<f64>] {
        &self.starts
    }
}
