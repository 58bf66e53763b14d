//! Figures for people: a number, a thin space, a unit. What is not finite is a dash.

use kerbside_geometry::{angle, math};

/// Stands for what is not known.
pub const UNKNOWN: &str = "\u{2013}";
const MINUS: &str = "\u{2212}";
const THIN_SPACE: char = '\u{202f}';

/// `value` with so many decimals, a true minus sign, and no negative zero; with an exponent from
/// 1e9 on.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return UNKNOWN.to_owned();
    }
    let size = value.abs();
    // Beyond that, places say nothing and fill the line.
    let digits = if size < 1e9 { format!("{size:.decimals$}") } else { format!("{size:.2e}") };
    let is_zero = digits.bytes().all(|byte| matches!(byte, b'0' | b'.'));
    if value < 0.0 && !is_zero { format!("{MINUS}{digits}") } else { digits }
}

/// As [`fixed`], with a plus sign where the value is positive.
#[must_use]
pub fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    let is_positive = value.is_finite() && text.bytes().any(|byte| matches!(byte, b'1'..=b'9'));
    if value > 0.0 && is_positive { format!("+{text}") } else { text }
}

/// `text` and `unit`, kept on one line; a dash stays alone.
#[must_use]
pub fn with_unit(text: &str, unit: &str) -> String {
    if text == UNKNOWN || unit.is_empty() {
        text.to_owned()
    } else {
        format!("{text}{THIN_SPACE}{unit}")
    }
}

/// A length in millimetres, signed.
#[must_use]
pub fn millimetres(metres: f64) -> String {
    with_unit(&signed(metres * 1e3, 1), "mm")
}

/// A length in metres.
#[must_use]
pub fn metres(metres: f64) -> String {
    with_unit(&fixed(metres, 2), "m")
}

/// An angle in degrees, signed.
#[must_use]
pub fn degrees(radians: f64) -> String {
    with_unit(&signed(angle::degrees(radians), 2), "deg")
}

/// A time in seconds.
#[must_use]
pub fn seconds(seconds: f64) -> String {
    with_unit(&fixed(seconds, 2), "s")
}

/// A short time with three digits in the unit that suits it: us, ms or s.
#[must_use]
pub fn duration(seconds: f64) -> String {
    let size = seconds.abs();
    let (scaled, unit) = if size < 0.999_5e-3 {
        (seconds * 1e6, "us")
    } else if size < 0.999_5 {
        (seconds * 1e3, "ms")
    } else {
        (seconds, "s")
    };
    with_unit(&three_digits(scaled), unit)
}

/// `value` with three significant digits, as far as decimals can give them.
#[must_use]
pub fn three_digits(value: f64) -> String {
    let decimals = match value.abs() {
        size if size < 0.01 && size > 0.0 => 4,
        size if size < 9.995 => 2,
        size if size < 99.95 => 1,
        _ => 0,
    };
    let text = fixed(value, decimals);
    if text == "0.00" { "0".to_owned() } else { text }
}

/// `value` with so many significant digits, written out as decimals; places before the point all stay.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    fixed(value, decimals_of(value, digits))
}

/// A value to two digits of the half width of its interval, and the interval: 0.61 (0.52 to 0.70).
#[must_use]
pub fn interval([value, low, high]: [f64; 3]) -> String {
    let half = 0.5 * (high - low);
    let decimals =
        if half > 0.0 && half.is_finite() { decimals_of(half, 2) } else { decimals_of(value, 4) };
    let [value, low, high] = [value, low, high].map(|value| fixed(value, decimals));
    format!("{value} ({low} to {high})")
}

/// Decimals that show so many digits of `value`.
fn decimals_of(value: f64, digits: usize) -> usize {
    let size = value.abs();
    if !(size > 0.0 && size.is_finite()) {
        return digits.saturating_sub(1);
    }
    // The slack forgives the last bit of the logarithm at exact powers of ten; `as` saturates.
    let first = (log10(size) + 1e-9).floor();
    (digits as f64 - 1.0 - first).clamp(0.0, 12.0) as usize
}

/// A share in per cent.
#[must_use]
pub fn percent(share: f64) -> String {
    with_unit(&three_digits(share * 100.0), "%")
}

/// A probability; what is rounded to certainty says that it is no such thing.
#[must_use]
pub fn probability(value: f64) -> String {
    match value {
        certain if certain > 0.995 => ">\u{202f}0.99".to_owned(),
        none if none < 0.005 => "<\u{202f}0.01".to_owned(),
        between => fixed(between, 2),
    }
}

/// A count, its thousands apart.
#[must_use]
pub fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(THIN_SPACE);
        }
        text.push(digit);
    }
    text
}

/// `one` or `many`, with the count before it.
#[must_use]
pub fn plural(value: u64, one: &str, many: &str) -> String {
    format!("{} {}", count(value), if value == 1 { one } else { many })
}

/// What `show` makes of a figure that may be missing.
#[must_use]
pub fn optional(value: Option<f64>, show: impl Fn(f64) -> String) -> String {
    value.map_or_else(|| UNKNOWN.to_owned(), show)
}

/// Logarithm to base 10, the same on every machine.
pub(crate) fn log10(value: f64) -> f64 {
    math::ln(value) * core::f64::consts::LOG10_E
}

/// Ten to the power of `exponent`; correctly rounded for the whole exponents of everyday figures.
pub(crate) fn exp10(exponent: f64) -> f64 {
    let size = exponent.abs();
    let whole = size <= 22.0 && size.fract() == 0.0;
    if !whole {
        return math::powf(10.0, exponent);
    }
    // A loop over exact powers: 10^22 is the largest that f64 holds exactly.
    let power = (0..size as u32).fold(1.0, |power, _| power * 10.0);
    if exponent < 0.0 { 1.0 / power } else { power }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_zeros_are_as_a_person_writes_them() {
        assert_eq!(fixed(-0.04, 1), "0.0");
        assert_eq!(fixed(-1.25, 1), "\u{2212}1.2");
        assert_eq!(signed(0.04, 1), "0.0");
        assert_eq!(signed(0.06, 1), "+0.1");
        assert_eq!(fixed(-1.234e12, 1), "\u{2212}1.23e12");
        assert_eq!(signed(f64::NAN, 1), UNKNOWN);
        assert_eq!(signed(f64::INFINITY, 1), UNKNOWN);
    }

    #[test]
    fn units_follow_the_size() {
        assert_eq!(duration(58e-6), "58.0\u{202f}us");
        assert_eq!(duration(999.6e-6), "1.00\u{202f}ms");
        assert_eq!(duration(0.0123), "12.3\u{202f}ms");
        assert_eq!(duration(2.5), "2.50\u{202f}s");
        assert_eq!(duration(0.0), "0\u{202f}us");
        assert_eq!(duration(f64::NAN), UNKNOWN);
        assert_eq!(millimetres(-0.0123), "\u{2212}12.3\u{202f}mm");
        assert_eq!(degrees(core::f64::consts::FRAC_PI_2), "+90.00\u{202f}deg");
        assert_eq!(optional(None, metres), UNKNOWN);
    }

    #[test]
    fn digits_follow_what_is_known() {
        assert_eq!(significant(0.012_34, 2), "0.012");
        assert_eq!(significant(0.1, 2), "0.10");
        assert_eq!(significant(-123.4, 2), "\u{2212}123");
        assert_eq!(significant(0.0, 3), "0.00");
        assert_eq!(significant(f64::NAN, 3), UNKNOWN);
        assert_eq!(interval([0.612, 0.52, 0.703]), "0.612 (0.520 to 0.703)");
        assert_eq!(interval([0.05, 0.05, 0.05]), "0.05000 (0.05000 to 0.05000)");
        assert_eq!(interval([0.2, 0.1, f64::INFINITY]), "0.2000 (0.1000 to \u{2013})");
    }

    #[test]
    fn nothing_is_certain() {
        assert_eq!(probability(0.9999), ">\u{202f}0.99");
        assert_eq!(probability(0.97), "0.97");
        assert_eq!(probability(0.0), "<\u{202f}0.01");
        assert_eq!(probability(f64::NAN), UNKNOWN);
    }

    #[test]
    fn thousands_stand_apart() {
        assert_eq!(count(0), "0");
        assert_eq!(count(999), "999");
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(plural(1, "gap", "gaps"), "1 gap");
    }

    #[test]
    fn powers_of_ten_are_the_decimal_ones() {
        for (exponent, power) in [(-6.0, 1e-6), (-1.0, 0.1), (0.0, 1.0), (5.0, 1e5), (22.0, 1e22)] {
            assert_eq!(exp10(exponent), power);
        }
        assert!((exp10(0.5) - core::f64::consts::SQRT_2 * 5.0_f64.sqrt()).abs() < 1e-12);
    }
}
