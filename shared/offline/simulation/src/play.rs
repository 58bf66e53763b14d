//! Play between two parts.

/// The play operator: what is driven stands still until the driver has crossed the play, then is
/// pushed along at half the width behind it.
///
/// M. Krasnoselskii, A. Pokrovskii, Systems with Hysteresis (1989).
#[derive(Clone, Debug)]
pub(crate) struct Play {
    half: f64,
    value: f64,
}

impl Play {
    /// Centred at zero, of full width `width`.
    pub(crate) fn new(width: f64) -> Self {
        Self { half: 0.5 * width, value: 0.0 }
    }

    /// Where the driven part stands.
    pub(crate) fn value(&self) -> f64 {
        self.value
    }

    /// Where it would stand once the driver went to each of `drivers` in turn, each time without
    /// turning back on the way.
    pub(crate) fn ahead<const N: usize>(&self, drivers: [f64; N]) -> [f64; N] {
        let mut value = self.value;
        if self.half == 0.0 {
            return drivers;
        }
        drivers.map(|driver| {
            value = value.max(driver - self.half).min(driver + self.half);
            value
        })
    }

    /// Moves on to a value that [`Self::ahead`] foretold.
    pub(crate) fn move_to(&mut self, value: f64) {
        self.value = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_driven_stands_still_within_the_play_and_follows_beyond() {
        let play = Play::new(0.2);
        let followed = play.ahead([0.05, 0.1, 0.3, 0.2, 0.1, 0.0, -0.5, -0.4]);
        assert_eq!(followed, [0.0, 0.0, 0.3 - 0.1, 0.3 - 0.1, 0.3 - 0.1, 0.1, -0.5 + 0.1, -0.4]);
    }

    #[test]
    fn without_play_the_driver_comes_through_to_the_bit() {
        let play = Play::new(0.0);
        let drivers = [0.1, -0.0, 0.3, 1e-300, -0.7];
        assert_eq!(play.ahead(drivers).map(f64::to_bits), drivers.map(f64::to_bits));
    }
}
