//! Quantiles of a few values.

/// The smallest value that at least this share of the values does not exceed; none of none.
#[must_use]
pub fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let index = (share * (values.len() as f64 - 1.0)).ceil().max(0.0) as usize;
    values.get(index).copied()
}

#[cfg(test)]
mod tests {
    use super::quantile;

    #[test]
    fn quantiles_are_values_that_were_there() {
        let values = || (1..=101).map(f64::from);
        assert_eq!(quantile(values(), 0.0), Some(1.0));
        assert_eq!(quantile(values(), 0.5), Some(51.0));
        assert_eq!(quantile(values(), 0.99), Some(100.0));
        assert_eq!(quantile(values(), 1.0), Some(101.0));
        assert_eq!(quantile([], 0.5), None);
    }
}
