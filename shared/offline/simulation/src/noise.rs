//! How the sensors of the simulated vehicle err.

/// Strength of each error; zero leaves it out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Of each wheel's travel on its own: Gaussian with variance `wheel`^2 |travel| \[m/sqrt(m)\].
    pub wheel: f64,
    /// Of the steering sensor: white, standard deviation \[rad\].
    pub steering: f64,
    /// Of the gyro: white, standard deviation \[rad/s\].
    pub gyro: f64,
    /// Where between two counts an encoder stands at first: evenly drawn from so much of a count, 0
    /// to 1.
    pub phase: f64,
}

impl Noise {
    /// Sensors without error; counts are still whole numbers.
    pub const NONE: Self = Self { wheel: 0.0, steering: 0.0, gyro: 0.0, phase: 0.0 };
}

impl Default for Noise {
    /// 0.5 mm per square root of a metre, 0.2 degrees, 3 mrad/s, any phase.
    fn default() -> Self {
        Self { wheel: 0.0005, steering: 0.2_f64.to_radians(), gyro: 0.003, phase: 1.0 }
    }
}
