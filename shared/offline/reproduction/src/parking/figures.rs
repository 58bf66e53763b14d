//! Figures of row 9.

use kerbside_geometry::angle;

use super::{Driver, Parkings, Scene};
use crate::figure::{Accept, Figure};
use crate::statistics::{all, bootstrap, mean, mean_between, quantile, share};

/// The garage triple of the paper's Table 3: x along the slot's axis, y across \[m\], heading \[rad\].
const TRIPLE: [f64; 3] = [0.0124, 0.0238, 1.22 / 180.0 * core::f64::consts::PI];

impl Parkings {
    fn column(&self, axis: usize) -> Vec<f64> {
        self.ends.iter().map(|end| end[axis]).collect()
    }

    /// Mean of an error (0 x, 1 y, 2 heading) \[m or rad\].
    #[must_use]
    pub fn mean(&self, axis: usize) -> f64 {
        mean(self.column(axis))
    }

    /// Mean of its magnitude.
    #[must_use]
    pub fn mean_abs(&self, axis: usize) -> f64 {
        mean(self.column(axis).into_iter().map(f64::abs))
    }

    /// Magnitude that 95 % stay below.
    #[must_use]
    pub fn p95(&self, axis: usize) -> f64 {
        quantile(self.column(axis).into_iter().map(f64::abs).collect(), 0.95)
    }

    /// How many ended inside the garage triple of the paper's Table 3.
    #[must_use]
    pub fn inside(&self) -> usize {
        let within = |end: &&[f64; 3]| (0..3).all(|axis| end[axis].abs() <= TRIPLE[axis]);
        self.ends.iter().filter(within).count()
    }

    fn figures(&self) -> Vec<Figure> {
        let held = self.driver == Driver::Fused;
        let only = |accept: Accept| if held { accept } else { Accept::Shown };
        let place = format!("{}, {}", self.scene.name(), self.driver.name());
        let limits = [("x", "mm", 1e3, 5.0), ("y", "mm", 1e3, 8.0), ("heading", "deg", 1.0, 0.55)];
        let mut figures = Vec::new();
        for (axis, (name, unit, scale, limit)) in limits.into_iter().enumerate() {
            let scaled = |value: f64| if axis == 2 { angle::degrees(value) } else { scale * value };
            let values: Vec<f64> =
                self.column(axis).into_iter().map(|value| scaled(value.abs())).collect();
            let (ours, interval) = mean_between(&values, self.seed);
            let accept = only(Accept::AtMost(limit));
            let figure = Figure::new(9, format!("mean |{name}|, {place}"), unit, ours, accept);
            figures.push(figure.between(interval).beside(self.scene.paper()[axis]));
            let p95 = Figure::new(
                9,
                format!("p95 |{name}|, {place}"),
                unit,
                scaled(self.p95(axis)),
                Accept::Shown,
            );
            figures.push(p95);
        }
        let (inside, interval) = share(self.inside(), self.ends.len());
        let accept = match self.driver {
            Driver::Fused => Accept::AtLeast(0.98),
            // It has to fail: calibration is what the paper is about.
            Driver::Uncalibrated => Accept::AtMost(0.02),
            _ => Accept::Shown,
        };
        figures.push(
            Figure::new(9, format!("inside Table 3, {place}"), "", inside, accept)
                .between(interval),
        );
        figures
    }
}

/// The figures of row 9.
pub(crate) fn figures(lines: &[Parkings]) -> Vec<Figure> {
    let mut figures: Vec<Figure> = lines.iter().flat_map(Parkings::figures).collect();
    for scene in Scene::ALL {
        let of = |driver: Driver| {
            let line = lines.iter().find(|line| line.scene == scene && line.driver == driver);
            line.map_or(Vec::new(), |line| line.column(1))
        };
        let (fused, rear) = (of(Driver::Fused), of(Driver::Rear));
        let size =
            |values: &[f64], indices: &[usize]| mean(indices.iter().map(|i| values[*i].abs()));
        let ratio = |indices: &[usize]| size(&fused, indices) / size(&rear, indices);
        let count = fused.len();
        let name = format!("fused/rear mean |y|, {}", scene.name());
        figures.push(
            Figure::new(9, name, "", ratio(&all(count)), Accept::AtMost(0.75))
                .between(bootstrap(count, 9, ratio)),
        );
    }
    figures
}
