//! Effects as a file lists them.

use core::fmt;

use kerbside_geometry::{WHEELS, Wheel};

use super::{Definition, LIBRARY, Parameter, definition};

/// One effect with its values.
#[derive(Clone, Debug)]
pub struct Effect {
    definition: &'static Definition,
    wheel: Option<Wheel>,
    values: Vec<f64>,
}

impl Effect {
    /// The effect `id` with its parameters by name, in any order, and the wheel of one that each
    /// wheel has on its own.
    ///
    /// # Errors
    /// What is not known, missing, given twice or outside what has a meaning.
    pub fn new(
        id: &str,
        wheel: Option<Wheel>,
        parameters: &[(&str, f64)],
    ) -> Result<Self, OverlayError> {
        let definition =
            definition(id).ok_or_else(|| OverlayError::UnknownEffect { found: id.to_owned() })?;
        if wheel.is_some() != definition.per_wheel {
            return Err(OverlayError::Wheel { id: definition.id, needed: definition.per_wheel });
        }
        let known = |name: &str| definition.parameters.iter().any(|known| known.name == name);
        for (index, (name, _)) in parameters.iter().enumerate() {
            if !known(name) {
                let found = (*name).to_owned();
                return Err(OverlayError::UnknownParameter { id: definition.id, found });
            }
            if parameters[..index].iter().any(|(earlier, _)| earlier == name) {
                let found = (*name).to_owned();
                return Err(OverlayError::ParameterTwice { id: definition.id, found });
            }
        }
        let values = definition.parameters.iter().map(|parameter| {
            let (id, name, allowed) = (definition.id, parameter.name, parameter.allowed);
            let (_, value) = parameters
                .iter()
                .find(|(found, _)| *found == name)
                .ok_or(OverlayError::Missing { id, name })?;
            // Written so that a value that is no number is outside.
            if *value >= allowed.0 && *value <= allowed.1 {
                Ok(*value)
            } else {
                Err(OverlayError::Outside { id, name, found: *value, allowed })
            }
        });
        Ok(Self { definition, wheel, values: values.collect::<Result<_, _>>()? })
    }

    /// What effect it is.
    #[must_use]
    pub fn definition(&self) -> &'static Definition {
        self.definition
    }

    /// The wheel it sits at, of an effect that each wheel has on its own.
    #[must_use]
    pub fn wheel(&self) -> Option<Wheel> {
        self.wheel
    }

    /// The values in the order of the definition's parameters.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The value of the parameter `name`.
    #[must_use]
    pub fn value(&self, name: &str) -> Option<f64> {
        let index = self.definition.parameters.iter().position(|known| known.name == name)?;
        self.values.get(index).copied()
    }

    /// Each value with its place among all parameters.
    pub fn parameters(&self) -> impl Iterator<Item = (Parameter, f64)> {
        Parameter::of(self.definition.id)
            .filter(|parameter| parameter.wheel() == self.wheel)
            .zip(self.values.iter().copied())
    }
}

impl PartialEq for Effect {
    fn eq(&self, other: &Self) -> bool {
        (self.definition.id, self.wheel, &self.values)
            == (other.definition.id, other.wheel, &other.values)
    }
}

/// Effects to be added to the nominal vehicle, none of them twice, in any order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overlay(Vec<Effect>);

impl Overlay {
    /// The nominal vehicle.
    #[must_use]
    pub const fn new() -> Self {
        Self(Vec::new())
    }

    /// Adds an effect.
    ///
    /// # Errors
    /// When it is there already.
    pub fn add(&mut self, effect: Effect) -> Result<(), OverlayError> {
        if self.0.iter().any(|there| there.definition.id == effect.definition.id) {
            return Err(OverlayError::EffectTwice { id: effect.definition.id });
        }
        self.0.push(effect);
        Ok(())
    }

    /// The effects in the order of adding.
    #[must_use]
    pub fn effects(&self) -> &[Effect] {
        &self.0
    }

    /// Whether the vehicle stays nominal.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl fmt::Display for Overlay {
    /// The text of an overlay file, which reads back as the same bits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, effect) in self.0.iter().enumerate() {
            let gap = if index == 0 { "" } else { "\n" };
            writeln!(f, "{gap}[[effect]]\nid = \"{}\"", effect.definition.id)?;
            if let Some(wheel) = effect.wheel {
                writeln!(f, "wheel = \"{}\"", wheel.name())?;
            }
            for (parameter, value) in effect.definition.parameters.iter().zip(&effect.values) {
                // Debug keeps the point of a whole number, as a float in TOML needs.
                writeln!(f, "{} = {value:?}", parameter.name)?;
            }
        }
        Ok(())
    }
}

/// Why effects are no overlay.
#[derive(Clone, Debug, PartialEq)]
pub enum OverlayError {
    /// No effect of this name.
    UnknownEffect {
        /// The name.
        found: String,
    },
    /// The effect has no parameter of this name.
    UnknownParameter {
        /// The effect.
        id: &'static str,
        /// The name.
        found: String,
    },
    /// A parameter is given twice.
    ParameterTwice {
        /// The effect.
        id: &'static str,
        /// The parameter.
        found: String,
    },
    /// A parameter is not given.
    Missing {
        /// The effect.
        id: &'static str,
        /// The parameter.
        name: &'static str,
    },
    /// A value has no meaning.
    Outside {
        /// The effect.
        id: &'static str,
        /// The parameter.
        name: &'static str,
        /// The value.
        found: f64,
        /// Smallest and largest value with a meaning.
        allowed: (f64, f64),
    },
    /// The wheel is missing, or the effect has none.
    Wheel {
        /// The effect.
        id: &'static str,
        /// Whether a wheel is to be named.
        needed: bool,
    },
    /// An effect is there twice.
    EffectTwice {
        /// The effect.
        id: &'static str,
    },
}

impl OverlayError {
    /// The key that is wrong in a file: `id`, `wheel` or a parameter's name.
    #[must_use]
    pub fn key(&self) -> &str {
        match self {
            Self::UnknownEffect { .. } | Self::EffectTwice { .. } => "id",
            Self::UnknownParameter { found, .. } | Self::ParameterTwice { found, .. } => found,
            Self::Missing { name, .. } | Self::Outside { name, .. } => name,
            Self::Wheel { .. } => "wheel",
        }
    }

    /// What would be right.
    #[must_use]
    pub fn allowed(&self) -> String {
        match self {
            Self::UnknownEffect { .. } => {
                let ids: Vec<&str> = LIBRARY.iter().map(|definition| definition.id).collect();
                format!("one of {}", ids.join(", "))
            }
            Self::UnknownParameter { id, .. }
            | Self::ParameterTwice { id, .. }
            | Self::Missing { id, .. } => {
                let definition = definition(id);
                let names: Vec<&str> = definition
                    .iter()
                    .flat_map(|definition| definition.parameters)
                    .map(|parameter| parameter.name)
                    .collect();
                format!("{} once each", names.join(", "))
            }
            Self::Outside { allowed: (low, high), .. } => format!("{low} to {high}"),
            Self::Wheel { needed: true, .. } => {
                format!("one of {}", WHEELS.map(Wheel::name).join(", "))
            }
            Self::Wheel { needed: false, .. } => "no wheel".to_owned(),
            Self::EffectTwice { .. } => "every effect once".to_owned(),
        }
    }
}

impl fmt::Display for OverlayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownEffect { found } => write!(f, "no effect is called {found:?}"),
            Self::UnknownParameter { id, found } => write!(f, "{id} has no parameter {found:?}"),
            Self::ParameterTwice { id, found } => write!(f, "{id}: {found} is given twice"),
            Self::Missing { id, name } => write!(f, "{id}: {name} is missing"),
            Self::Outside { id, name, found, .. } => write!(f, "{id}: {name} is {found}"),
            Self::Wheel { id, needed: true } => write!(f, "{id}: no wheel is named"),
            Self::Wheel { id, needed: false } => write!(f, "{id} does not belong to one wheel"),
            Self::EffectTwice { id } => write!(f, "{id} is there twice"),
        }?;
        write!(f, "; allowed: {}", self.allowed())
    }
}

impl core::error::Error for OverlayError {}
