//! Readings that no vehicle can have caused: single rows far off the line between their neighbours.

use crate::bins::to_f64;
use crate::case::Series;

/// Times the usual distance from that line at which a row stands out.
const FAR: f64 = 12.0;
/// Rows that are farther apart than this many usual periods are no neighbours.
const APART: f64 = 3.0;
/// A median of normal deviates' magnitudes is this much less than their standard deviation.
const NORMAL: f64 = 1.4826;

/// Takes out the rows of `series` that stand out in one of `columns`: each column with the least distance that may
/// count, beside what it usually is. Returns how many.
pub(crate) fn drop_outliers<const N: usize>(
    series: &mut Series<N>,
    columns: &[(usize, f64)],
) -> usize {
    let mut out = vec![false; series.t.len()];
    for (column, least) in columns {
        let rows: Vec<usize> =
            (0..series.t.len()).filter(|row| series.value[*row][*column].is_finite()).collect();
        if rows.len() < 8 {
            continue;
        }
        let at = |k: usize| (series.t[rows[k]], series.value[rows[k]][*column]);
        let mut periods: Vec<f64> = (1..rows.len()).map(|k| at(k).0 - at(k - 1).0).collect();
        let apart = APART * median(&mut periods);
        let offs: Vec<f64> = (0..rows.len()).map(|k| off(k, rows.len(), apart, &at)).collect();
        let mut known: Vec<f64> =
            offs.iter().copied().filter(|off| off.is_finite()).map(f64::abs).collect();
        let limit = (FAR * NORMAL * median(&mut known)).max(*least);
        for (k, row) in rows.iter().enumerate() {
            // A neighbour of what stands out is off by half as much, the other way.
            let beside = |other: Option<usize>| {
                other.and_then(|k| offs.get(k)).is_some_and(|other| other.abs() > offs[k].abs())
            };
            if offs[k].abs() > limit && !beside(k.checked_sub(1)) && !beside(Some(k + 1)) {
                out[*row] = true;
            }
        }
    }
    let dropped = out.iter().filter(|out| **out).count();
    if dropped > 0 {
        let mut kept = out.iter().map(|out| !out);
        series.t.retain(|_| kept.next().unwrap_or(true));
        let mut kept = out.iter().map(|out| !out);
        series.value.retain(|_| kept.next().unwrap_or(true));
    }
    dropped
}

/// How far a value is off the line through its neighbours: those on both sides, or beside a gap the two on the other
/// side; not a number where there are none.
fn off(k: usize, count: usize, apart: f64, at: &impl Fn(usize) -> (f64, f64)) -> f64 {
    let near = |i: usize, j: usize| at(j).0 - at(i).0 <= apart;
    let before = k > 0 && near(k - 1, k);
    let after = k + 1 < count && near(k, k + 1);
    let (i, j) = match (before, after) {
        (true, true) => (k - 1, k + 1),
        (false, true) if k + 2 < count && near(k + 1, k + 2) => (k + 1, k + 2),
        (true, false) if k > 1 && near(k - 2, k - 1) => (k - 2, k - 1),
        _ => return f64::NAN,
    };
    let ((t0, v0), (t1, v1), (t, v)) = (at(i), at(j), at(k));
    let share = (t - t0) / (t1 - t0);
    // Beside a gap the line is carried on, and its own errors with it.
    let scale = if (0.0..=1.0).contains(&share) { 1.0 } else { 2.0 };
    (v - (v0 + share * (v1 - v0))) / scale
}

fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// White noise of a column by its second differences: what a smooth motion leaves of them is noise; none where there
/// are too few rows.
pub(crate) fn white<const N: usize>(series: &Series<N>, column: usize) -> Option<f64> {
    let values: Vec<f64> =
        series.value.iter().map(|row| row[column]).filter(|value| value.is_finite()).collect();
    if values.len() < 16 {
        return None;
    }
    let mut second: Vec<f64> =
        values.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).collect();
    let mean = second.iter().sum::<f64>() / to_f64(second.len());
    // Where most differences are nothing, the reading is coarse: then the mean says more than the median.
    Some((NORMAL * median(&mut second)).max(0.5 * mean) / 6.0_f64.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn smooth(rows: usize) -> Series<1> {
        let t: Vec<f64> = (0..rows).map(|k| 0.1 * to_f64(k)).collect();
        let wave = |t: &f64| [kerbside_geometry::math::sin(*t) + 0.001 * (t * 77.0 % 1.0)];
        Series { value: t.iter().map(wave).collect(), t }
    }

    #[test]
    fn what_stands_out_is_dropped_and_nothing_else() {
        let clean = smooth(200);
        let mut series = clean.clone();
        assert_eq!(drop_outliers(&mut series, &[(0, 0.01)]), 0);
        series.value[50][0] += 0.5;
        series.value[120][0] -= 0.3;
        assert_eq!(drop_outliers(&mut series, &[(0, 0.01)]), 2);
        assert_eq!(series.t.len(), 198);
        assert!(!series.t.contains(&clean.t[50]) && !series.t.contains(&clean.t[120]));
    }

    #[test]
    fn what_stands_out_beside_a_gap_is_dropped() {
        let mut series = smooth(200);
        series.t.drain(80..120);
        series.value.drain(80..120);
        series.value[79][0] += 0.5;
        series.value[80][0] -= 0.5;
        assert_eq!(drop_outliers(&mut series, &[(0, 0.01)]), 2);
    }

    #[test]
    fn the_noise_of_a_smooth_motion_is_found() {
        let mut series = smooth(2000);
        let mut state = 1_u64;
        for row in &mut series.value {
            let mut sum = 0.0;
            for _ in 0..12 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                sum += f64::from((state >> 33) as u32) / f64::from(u32::MAX >> 1);
            }
            row[0] += 0.02 * (sum - 6.0);
        }
        let found = white(&series, 0).unwrap();
        assert!((0.015..0.027).contains(&found), "{found}");
    }
}
