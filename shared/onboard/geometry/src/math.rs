//! The one door to transcendental functions.
//!
//! All of kerbside's pure code takes them from here, never from `f64`'s own methods: those call the C library of
//! the machine, whose last bit differs between versions, and the same samples must give the same bits everywhere.
//! `sqrt`, `abs` and the four operations are exact by IEEE 754 and may be used as they are.

/// Sine of an angle \[rad\].
#[must_use]
pub fn sin(angle: f64) -> f64 {
    libm::sin(angle)
}

/// Cosine of an angle \[rad\].
#[must_use]
pub fn cos(angle: f64) -> f64 {
    libm::cos(angle)
}

/// Sine and cosine of an angle \[rad\].
#[must_use]
pub fn sin_cos(angle: f64) -> (f64, f64) {
    libm::sincos(angle)
}

/// Tangent of an angle \[rad\].
#[must_use]
pub fn tan(angle: f64) -> f64 {
    libm::tan(angle)
}

/// Arc sine \[rad\], of a value in -1..=1.
#[must_use]
pub fn asin(value: f64) -> f64 {
    libm::asin(value)
}

/// Arc cosine \[rad\], of a value in -1..=1.
#[must_use]
pub fn acos(value: f64) -> f64 {
    libm::acos(value)
}

/// Arc tangent \[rad\].
#[must_use]
pub fn atan(value: f64) -> f64 {
    libm::atan(value)
}

/// Angle \[rad\] of the vector (x, y), in -pi..=pi.
#[must_use]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Length of the vector (x, y).
#[must_use]
pub fn hypot(x: f64, y: f64) -> f64 {
    libm::hypot(x, y)
}

/// e to the power of `value`.
#[must_use]
pub fn exp(value: f64) -> f64 {
    libm::exp(value)
}

/// e to the power of `value`, minus one, accurate near zero.
#[must_use]
pub fn expm1(value: f64) -> f64 {
    libm::expm1(value)
}

/// Natural logarithm.
#[must_use]
pub fn ln(value: f64) -> f64 {
    libm::log(value)
}

/// `base` to the power of `exponent`.
#[must_use]
pub fn powf(base: f64, exponent: f64) -> f64 {
    libm::pow(base, exponent)
}

/// sin(x)/x, continued through zero: the chord of an arc over its length, for half the turned angle `x` \[rad\].
#[must_use]
pub fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-4 {
        let square = x * x;
        1.0 - square / 6.0 * (1.0 - square / 20.0)
    } else {
        sin(x) / x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sinc_is_continuous_where_the_series_takes_over() {
        for x in [1e-4_f64, -1e-4] {
            let (inside, outside) = (sinc(x * 0.999_999_999), sin(x) / x);
            assert!((inside - outside).abs() < 1e-15, "{inside} against {outside}");
        }
        assert_eq!(sinc(0.0), 1.0);
    }
}
