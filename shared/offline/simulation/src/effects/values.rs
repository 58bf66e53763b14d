//! The numbers of all effects at once.

use super::parameter::{NEUTRAL, blocks};
use super::{Overlay, Parameter};
use crate::plant::Plant;

/// The value of every [`Parameter`]: a point in the space of the vehicles that the simulator knows,
/// cheap to copy and to change by one coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effects {
    values: [f64; Parameter::COUNT],
}

impl Effects {
    /// The nominal vehicle.
    pub const NEUTRAL: Self = Self { values: NEUTRAL };

    /// The value of `parameter`.
    #[must_use]
    pub const fn get(&self, parameter: Parameter) -> f64 {
        self.values[parameter.index()]
    }

    /// Lets `parameter` be `value`, which nobody checks: a search may look beyond what an overlay
    /// may say. Delays and lags whose sum with the vehicle's own is negative count as none.
    pub const fn set(&mut self, parameter: Parameter, value: f64) {
        self.values[parameter.index()] = value;
    }

    /// The same with `parameter` at `value`.
    #[must_use]
    pub const fn with(mut self, parameter: Parameter, value: f64) -> Self {
        self.set(parameter, value);
        self
    }

    /// Alters `plant` by every effect that is not neutral.
    pub(crate) fn apply(&self, plant: &mut Plant) {
        for (definition, begin, width) in blocks() {
            let values = &self.values[begin..begin + width];
            if values != &NEUTRAL[begin..begin + width] {
                (definition.apply)(values, plant);
            }
        }
    }
}

impl Default for Effects {
    fn default() -> Self {
        Self::NEUTRAL
    }
}

impl From<&Overlay> for Effects {
    fn from(overlay: &Overlay) -> Self {
        let mut effects = Self::NEUTRAL;
        for effect in overlay.effects() {
            for (parameter, value) in effect.parameters() {
                effects.set(parameter, value);
            }
        }
        effects
    }
}
