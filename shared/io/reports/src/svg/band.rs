//! Bands: areas between two curves over a common axis.

use super::decimate::{envelope, finite_pieces, simplify};
use super::{Ink, Scale};

/// An area between a lower and an upper curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// For the legend.
    pub label: String,
    /// Colour.
    pub ink: Ink,
    /// (x, lower, upper), x never decreasing; what is not finite leaves a hole.
    pub points: Vec<[f64; 3]>,
}

impl Band {
    /// The outlines in figure units, one per piece without a hole.
    pub(crate) fn outlines(&self, x: &Scale, y: &Scale) -> Vec<Vec<[f64; 2]>> {
        let is_whole = |point: &[f64; 3]| {
            [x.at(point[0]), y.at(point[1]), y.at(point[2])].iter().all(|value| value.is_finite())
        };
        self.points
            .chunk_by(|a, b| is_whole(a) && is_whole(b))
            .filter(|piece| piece.len() > 1)
            .map(|piece| {
                let mut outline = edge(piece, 2, x, y);
                outline.extend(edge(piece, 1, x, y).into_iter().rev());
                outline
            })
            .collect()
    }
}

fn edge(piece: &[[f64; 3]], side: usize, x: &Scale, y: &Scale) -> Vec<[f64; 2]> {
    let points: Vec<_> = piece.iter().map(|point| [x.at(point[0]), y.at(point[side])]).collect();
    simplify(&envelope(&points, COLUMN), TOLERANCE, LIMIT)
}

/// Width of the columns that long curves are reduced to, in figure units.
pub(crate) const COLUMN: f64 = 0.5;
/// What a reduced line may be off by, in figure units.
pub(crate) const TOLERANCE: f64 = 0.1;
/// Points of the longest line drawn.
pub(crate) const LIMIT: usize = 4000;

/// The pieces of a curve over x in figure units, reduced to what can be seen.
pub(crate) fn curve(points: &[[f64; 2]], x: &Scale, y: &Scale) -> Vec<Vec<[f64; 2]>> {
    finite_pieces(points.iter().map(|point| [x.at(point[0]), y.at(point[1])]))
        .iter()
        .map(|piece| simplify(&envelope(piece, COLUMN), TOLERANCE, LIMIT))
        .collect()
}
