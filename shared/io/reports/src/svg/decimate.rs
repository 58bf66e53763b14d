//! Fewer points, the same picture.

use kerbside_geometry::math;

/// Points of `line` that keep every other point within `tolerance` of the line through them, ends
/// included; at most `limit` of them (at least 2), the tolerance being doubled as often as that
/// takes.
///
/// Douglas and Peucker, "Algorithms for the reduction of the number of points required to represent
/// a digitized line", 1973, after a first pass that drops points closer than a quarter of the
/// tolerance to the last one kept.
#[must_use]
pub fn simplify(line: &[[f64; 2]], tolerance: f64, limit: usize) -> Vec<[f64; 2]> {
    let (limit, mut tolerance) = (limit.max(2), tolerance.max(f64::MIN_POSITIVE));
    let mut kept = within(line, tolerance);
    while kept.len() > limit {
        tolerance *= 2.0;
        kept = within(line, tolerance);
    }
    kept
}

fn within(line: &[[f64; 2]], tolerance: f64) -> Vec<[f64; 2]> {
    let sparse = thinned(line, 0.25 * tolerance);
    if sparse.len() < 3 {
        return sparse;
    }
    let mut keep = vec![false; sparse.len()];
    (keep[0], keep[sparse.len() - 1]) = (true, true);
    let mut open = vec![(0, sparse.len() - 1)];
    while let Some((first, last)) = open.pop() {
        let Some((index, distance)) = farthest(&sparse, first, last) else { continue };
        if distance > 0.75 * tolerance {
            keep[index] = true;
            open.extend([(first, index), (index, last)]);
        }
    }
    sparse.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(point, _)| *point).collect()
}

/// Drops points near the last one kept; the end always stays.
fn thinned(line: &[[f64; 2]], distance: f64) -> Vec<[f64; 2]> {
    let mut kept: Vec<[f64; 2]> = Vec::new();
    for (index, point) in line.iter().enumerate() {
        let is_far = kept.last().is_none_or(|last| length(*point, *last) > distance);
        let is_end = index + 1 == line.len() && kept.last() != Some(point);
        if is_far || is_end {
            kept.push(*point);
        }
    }
    kept
}

fn farthest(line: &[[f64; 2]], first: usize, last: usize) -> Option<(usize, f64)> {
    let distances = (first + 1..last)
        .map(|index| (index, distance_to_segment(line[index], line[first], line[last])));
    distances.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Distance of a point from the segment between two others.
pub(crate) fn distance_to_segment(point: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let square = dx * dx + dy * dy;
    if square == 0.0 {
        return length(point, from);
    }
    let share = ((point[0] - from[0]) * dx + (point[1] - from[1]) * dy) / square;
    let share = share.clamp(0.0, 1.0);
    length(point, [from[0] + share * dx, from[1] + share * dy])
}

fn length(a: [f64; 2], b: [f64; 2]) -> f64 {
    math::hypot(a[0] - b[0], a[1] - b[1])
}

/// Of a line whose x never decreases: the first, lowest, highest and last point of every column
/// `width` wide. What is drawn through them covers the same pixels, peaks included.
#[must_use]
pub fn envelope(line: &[[f64; 2]], width: f64) -> Vec<[f64; 2]> {
    let mut kept = Vec::new();
    let mut start = 0;
    for index in 1..=line.len() {
        let column = |point: &[f64; 2]| (point[0] / width).floor();
        if line.get(index).is_none_or(|point| column(point) != column(&line[start])) {
            push_column(&mut kept, &line[start..index]);
            start = index;
        }
    }
    kept
}

fn push_column(kept: &mut Vec<[f64; 2]>, column: &[[f64; 2]]) {
    let heights = || column.iter().enumerate();
    let lowest = heights().min_by(|a, b| a.1[1].total_cmp(&b.1[1])).map(|(index, _)| index);
    let highest = heights().max_by(|a, b| a.1[1].total_cmp(&b.1[1])).map(|(index, _)| index);
    let (Some(lowest), Some(highest)) = (lowest, highest) else { return };
    let mut chosen = [0, lowest.min(highest), lowest.max(highest), column.len() - 1].to_vec();
    chosen.dedup();
    kept.extend(chosen.into_iter().map(|index| column[index]));
}

/// Cuts a line where a point is not finite. Pieces of one point are kept: they are drawn as a dot.
pub(crate) fn finite_pieces(points: impl IntoIterator<Item = [f64; 2]>) -> Vec<Vec<[f64; 2]>> {
    let mut pieces: Vec<Vec<[f64; 2]>> = vec![Vec::new()];
    for point in points {
        if point.iter().all(|value| value.is_finite()) {
            if let Some(piece) = pieces.last_mut() {
                piece.push(point);
            }
        } else {
            pieces.push(Vec::new());
        }
    }
    pieces.retain(|piece| !piece.is_empty());
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn distance_to_line(point: [f64; 2], line: &[[f64; 2]]) -> f64 {
        let ends = line.windows(2).map(|pair| distance_to_segment(point, pair[0], pair[1]));
        ends.fold(length(point, line[0]), f64::min)
    }

    #[test]
    fn a_straight_line_needs_two_points_and_a_circle_few() {
        let straight: Vec<_> = (0..1000).map(|i| [f64::from(i), 2.0 * f64::from(i)]).collect();
        assert_eq!(simplify(&straight, 0.1, 5000), [[0.0, 0.0], [999.0, 1998.0]]);
        let circle: Vec<_> = (0..=10_000)
            .map(|i| math::sin_cos(f64::from(i) * 1e-4 * core::f64::consts::TAU))
            .map(|(sin, cos)| [100.0 * cos, 100.0 * sin])
            .collect();
        let kept = simplify(&circle, 0.1, 5000);
        assert!(kept.len() > 30 && kept.len() < 200, "{}", kept.len());
    }

    #[test]
    fn pieces_are_cut_at_holes() {
        let hole = [f64::NAN, 0.0];
        let pieces = finite_pieces([hole, [0.0, 0.0], [1.0, 1.0], hole, hole, [2.0, 2.0]]);
        assert_eq!(pieces, [vec![[0.0, 0.0], [1.0, 1.0]], vec![[2.0, 2.0]]]);
        assert!(finite_pieces([hole]).is_empty());
    }

    #[test]
    fn a_single_spike_survives_the_envelope() {
        let mut line: Vec<_> = (0..100_000).map(|i| [f64::from(i) * 0.005, 0.0]).collect();
        line[54_321][1] = 7.0;
        line[54_322][1] = -7.0;
        let kept = envelope(&line, 0.5);
        assert!(kept.len() <= 4 * 1001, "{}", kept.len());
        assert!(kept.iter().any(|point| point[1] == 7.0));
        assert!(kept.iter().any(|point| point[1] == -7.0));
        assert!(kept.windows(2).all(|pair| pair[0][0] <= pair[1][0]));
        assert!(envelope(&[], 0.5).is_empty());
    }

    proptest! {
        #[test]
        fn every_point_stays_within_the_tolerance(
            steps in prop::collection::vec((-1.0_f64..1.0, -1.0_f64..1.0), 2..300),
            tolerance in 0.01_f64..5.0,
        ) {
            let mut at = [0.0, 0.0];
            let line: Vec<_> = steps
                .iter()
                .map(|(dx, dy)| {
                    at = [at[0] + dx, at[1] + dy];
                    at
                })
                .collect();
            let kept = simplify(&line, tolerance, usize::MAX);
            prop_assert_eq!(kept.first(), line.first());
            prop_assert_eq!(kept.last(), line.last());
            for point in &line {
                prop_assert!(distance_to_line(*point, &kept) <= tolerance * (1.0 + 1e-9));
            }
        }

        #[test]
        fn the_limit_holds(
            line in prop::collection::vec((-1e3_f64..1e3, -1e3_f64..1e3), 2..300),
            limit in 2_usize..40,
        ) {
            let line: Vec<_> = line.into_iter().map(|(x, y)| [x, y]).collect();
            prop_assert!(simplify(&line, 0.1, limit).len() <= limit);
        }
    }
}
