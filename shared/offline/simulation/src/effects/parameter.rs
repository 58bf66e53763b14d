//! Every number that an effect or a deviation has, as one list.

use core::fmt;

use kerbside_geometry::{Vehicle, WHEELS, Wheel};

use super::{DEVIATIONS, Definition, LIBRARY, ParameterDefinition};

/// One number of one effect (of one wheel), or one deviation of a car in good order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Parameter(u8);

/// Where a parameter belongs.
#[derive(Clone, Copy)]
struct Place {
    definition: &'static Definition,
    parameter: usize,
    wheel: Option<Wheel>,
}

const DEFINITIONS: usize = DEVIATIONS.len() + LIBRARY.len();

/// The deviations, then the effects: the order in which they are applied.
const fn applied(index: usize) -> &'static Definition {
    if index < DEVIATIONS.len() { DEVIATIONS[index] } else { LIBRARY[index - DEVIATIONS.len()] }
}

const fn width(definition: &Definition) -> usize {
    definition.parameters.len() * if definition.per_wheel { 4 } else { 1 }
}

const fn count() -> usize {
    let (mut sum, mut index) = (0, 0);
    while index < DEFINITIONS {
        sum += width(applied(index));
        index += 1;
    }
    sum
}

const PLACES: [Place; Parameter::COUNT] = {
    let first = Place { definition: DEVIATIONS[0], parameter: 0, wheel: None };
    let mut places = [first; Parameter::COUNT];
    let (mut next, mut index) = (0, 0);
    while index < DEFINITIONS {
        let definition = applied(index);
        let mut value = 0;
        while value < width(definition) {
            places[next] = if definition.per_wheel {
                Place { definition, parameter: value / 4, wheel: Some(WHEELS[value % 4]) }
            } else {
                Place { definition, parameter: value, wheel: None }
            };
            next += 1;
            value += 1;
        }
        index += 1;
    }
    places
};

static PLACE: [Place; Parameter::COUNT] = PLACES;

impl Parameter {
    /// How many there are.
    pub const COUNT: usize = count();

    /// All of them.
    pub fn all() -> impl DoubleEndedIterator<Item = Self> + ExactSizeIterator {
        #[allow(clippy::cast_possible_truncation)] // Held below.
        (0..Self::COUNT).map(|index| Self(index as u8))
    }

    /// The parameter `name` of the effect or deviation `id`; none where there is no such one or
    /// where each wheel has its own.
    #[must_use]
    pub fn find(id: &str, name: &str) -> Option<Self> {
        Self::search(id, name, None)
    }

    /// The parameter `name` of the effect or deviation `id` at `wheel`.
    #[must_use]
    pub fn find_at(id: &str, name: &str, wheel: Wheel) -> Option<Self> {
        Self::search(id, name, Some(wheel))
    }

    fn search(id: &str, name: &str, wheel: Option<Wheel>) -> Option<Self> {
        Self::all().find(|parameter| {
            parameter.effect().id == id
                && parameter.definition().name == name
                && parameter.wheel() == wheel
        })
    }

    /// The parameters of the effect or deviation `id`.
    pub fn of(id: &str) -> impl Iterator<Item = Self> {
        Self::all().filter(move |parameter| parameter.effect().id == id)
    }

    /// Place among [`Self::all`].
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    fn place(self) -> &'static Place {
        &PLACE[self.index()]
    }

    /// The effect or deviation it belongs to.
    #[must_use]
    pub fn effect(self) -> &'static Definition {
        self.place().definition
    }

    /// What its effect declares of it.
    #[must_use]
    pub fn definition(self) -> &'static ParameterDefinition {
        let place = self.place();
        &place.definition.parameters[place.parameter]
    }

    /// The wheel whose number it is; none where the wheels have none of their own.
    #[must_use]
    pub fn wheel(self) -> Option<Wheel> {
        self.place().wheel
    }

    /// Whether no overlay can name it: a deviation of a car in good order.
    #[must_use]
    pub fn is_deviation(self) -> bool {
        DEVIATIONS.iter().any(|deviation| deviation.id == self.effect().id)
    }

    /// The value that changes nothing.
    #[must_use]
    pub fn neutral(self) -> f64 {
        self.definition().neutral
    }

    /// What a sane search covers for `vehicle`.
    #[must_use]
    pub fn range_for(self, vehicle: &Vehicle) -> (f64, f64) {
        self.definition().range_for(vehicle)
    }
}

impl fmt::Display for Parameter {
    /// `understeer.gradient`, `count_loss.fraction.rl`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.effect().id, self.definition().name)?;
        self.wheel().map_or(Ok(()), |wheel| write!(f, ".{}", wheel.name()))
    }
}

const _: () = assert!(Parameter::COUNT <= u8::MAX as usize, "an index has eight bits");

/// Every effect and deviation in the order of application, with the place of its first value and
/// their number.
pub(super) fn blocks() -> impl Iterator<Item = (&'static Definition, usize, usize)> {
    let mut begin = 0;
    (0..DEFINITIONS).map(move |index| {
        let definition = applied(index);
        let width = width(definition);
        begin += width;
        (definition, begin - width, width)
    })
}

/// The neutral value of each.
pub(super) const NEUTRAL: [f64; Parameter::COUNT] = {
    let mut values = [0.0; Parameter::COUNT];
    let mut index = 0;
    while index < Parameter::COUNT {
        values[index] = PLACES[index].definition.parameters[PLACES[index].parameter].neutral;
        index += 1;
    }
    values
};
