//! Time cut into bins: within a bin the rows of a sensor are averaged, and the model is averaged over the very same
//! stamps, so that nothing is resampled and nothing is differentiated.

use kerbside_geometry::Pose;

use crate::case::{Run, Series, Wheels};

/// Number of channels.
pub const CHANNELS: usize = 9;
/// Channel of the first of the four wheels.
pub const WHEEL: usize = 0;
/// Channel of the steering sensor.
pub const STEERING: usize = 4;
/// Channel of the gyro.
pub const GYRO: usize = 5;
/// Channel of the reference's x; y and yaw follow.
pub const REFERENCE: usize = 6;

/// Values of all channels in a bin; one that is missing is NaN. Wheels: cumulative travel at the nominal radius \[m\],
/// or speed \[m/s\]; steering \[rad\]; gyro \[rad/s\]; pose of the compared point in the reference frame \[m, m, rad\].
pub type Channels = [f64; CHANNELS];

/// No value at all.
pub const MISSING: Channels = [f64::NAN; CHANNELS];

/// Width of a bin unless sensors are too slow for it \[s\].
pub const WIDTH: f64 = 0.25;
/// Rows of one sensor in a bin beyond which neighbours are merged first.
const ROWS: f64 = 10.0;

/// The rows of one sensor, bin by bin.
#[derive(Clone, Debug)]
pub struct Rows<const N: usize> {
    /// Rows, neighbours merged where there are very many.
    pub series: Series<N>,
    /// First row of each bin, and one past the last bin.
    begin: Vec<usize>,
}

impl<const N: usize> Rows<N> {
    fn new(series: &Series<N>, grid: &Grid) -> Self {
        let series = thinned(series, grid.width);
        let edge = |bin: usize| grid.begin + grid.width * to_f64(bin);
        let begin =
            (0..=grid.bins).map(|bin| series.t.partition_point(|t| *t < edge(bin))).collect();
        Self { series, begin }
    }

    /// Mean over each bin of what `value` says of a row; `value` is called for the rows in their order.
    fn means(&self, mut value: impl FnMut(f64) -> [f64; N], mut put: impl FnMut(usize, [f64; N])) {
        for bin in 0..self.begin.len() - 1 {
            let (mut sum, mut count) = ([0.0; N], [0.0; N]);
            for row in self.begin[bin]..self.begin[bin + 1] {
                let at = value(self.series.t[row]);
                for column in 0..N {
                    if self.series.value[row][column].is_finite() {
                        sum[column] += at[column];
                        count[column] += 1.0;
                    }
                }
            }
            put(bin, core::array::from_fn(|column| sum[column] / count[column]));
        }
    }

    /// Mean number of rows in a bin that has any.
    fn per_bin(&self) -> f64 {
        let counts = self.begin.windows(2).map(|pair| pair[1] - pair[0]).filter(|count| *count > 0);
        let (bins, rows) = counts.fold((0, 0), |(bins, rows), count| (bins + 1, rows + count));
        to_f64(rows) / to_f64(bins.max(1))
    }
}

/// Neighbours merged, so that a bin has at most some ten rows.
fn thinned<const N: usize>(series: &Series<N>, width: f64) -> Series<N> {
    let Some((first, last)) = series.span() else { return Series::default() };
    let per_bin = to_f64(series.t.len()) * width / (last - first).max(width);
    let group = (per_bin / ROWS).ceil().max(1.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let group = group as usize;
    if group < 2 {
        return series.clone();
    }
    let mut merged = Series::default();
    for (t, value) in series.t.chunks(group).zip(series.value.chunks(group)) {
        let n = to_f64(t.len());
        merged.t.push(t.iter().sum::<f64>() / n);
        merged
            .value
            .push(core::array::from_fn(|c| value.iter().map(|row| row[c]).sum::<f64>() / n));
    }
    merged
}

#[derive(Clone, Copy, Debug)]
struct Grid {
    begin: f64,
    width: f64,
    bins: usize,
}

/// A run's rows in bins.
#[derive(Clone, Debug)]
pub struct Binned {
    /// Name of the run.
    pub name: String,
    begin: f64,
    /// Width of a bin \[s\].
    pub width: f64,
    wheels: Rows<4>,
    steering: Rows<1>,
    gyro: Rows<1>,
    reference: Rows<3>,
    radius: [f64; 4],
    /// Whether wheels are speeds.
    pub speeds: bool,
    /// Whether the reference tells the yaw: then the compared point is the body's, else the marker's.
    pub has_yaw: bool,
    marker: Pose,
    /// What was measured.
    pub measured: Vec<Channels>,
}

/// What a model shows at a stamp, asked in the order of time by each sensor.
pub trait Shown {
    /// Rotation of each wheel \[rad\].
    fn rotation(&mut self, t: f64) -> [f64; 4];
    /// Surface speed of each wheel as reported \[m/s\].
    fn wheel_speed(&mut self, t: f64) -> [f64; 4];
    /// Steering sensor \[rad\].
    fn steering(&mut self, t: f64) -> f64;
    /// Gyro \[rad/s\].
    fn yaw_rate(&mut self, t: f64) -> f64;
    /// The marker in the reference frame, yaw unwrapped.
    fn reference(&mut self, t: f64) -> Pose;
}

impl Binned {
    /// The rows of `run` in bins of `width` \[s\]; `radius` are the nominal ones, `marker` is `body_from_marker`.
    #[must_use]
    pub fn new(run: &Run, width: f64, radius: [f64; 4], marker: Pose) -> Self {
        let (begin, end) = run.span();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let bins = ((end - begin) / width).floor().max(1.0) as usize;
        let grid = Grid { begin, width, bins };
        let mut binned = Self {
            name: run.name.clone(),
            begin,
            width,
            wheels: Rows::new(run.wheels.series(), &grid),
            steering: Rows::new(&run.steering, &grid),
            gyro: Rows::new(&run.gyro, &grid),
            reference: Rows::new(&run.reference, &grid),
            radius,
            speeds: matches!(run.wheels, Wheels::Speed(_)),
            has_yaw: run.reference.has(2),
            marker,
            measured: Vec::new(),
        };
        binned.measured = binned.channels(&mut Recorded::new(&binned));
        binned
    }

    /// Number of bins.
    #[must_use]
    pub fn len(&self) -> usize {
        self.measured.len()
    }

    /// The middle of a bin \[s\].
    #[must_use]
    pub fn time(&self, bin: usize) -> f64 {
        self.begin + self.width * (to_f64(bin) + 0.5)
    }

    /// When the last bin ends \[s\].
    #[must_use]
    pub fn end(&self) -> f64 {
        self.begin + self.width * to_f64(self.wheels.begin.len() - 1)
    }

    /// Mean number of rows in a bin of: wheels, steering, gyro, reference.
    #[must_use]
    pub fn rows_per_bin(&self) -> [f64; 4] {
        [
            self.wheels.per_bin(),
            self.steering.per_bin(),
            self.gyro.per_bin(),
            self.reference.per_bin(),
        ]
    }

    /// What `shown` makes of the channels in every bin.
    pub fn channels(&self, shown: &mut impl Shown) -> Vec<Channels> {
        let mut bins = vec![MISSING; self.wheels.begin.len() - 1];
        let radius = self.radius;
        if self.speeds {
            self.wheels
                .means(|t| shown.wheel_speed(t), |bin, mean| bins[bin][..4].copy_from_slice(&mean));
        } else {
            self.wheels.means(
                |t| shown.rotation(t),
                |bin, mean| {
                    for wheel in 0..4 {
                        bins[bin][WHEEL + wheel] = mean[wheel] * radius[wheel];
                    }
                },
            );
        }
        self.steering.means(|t| [shown.steering(t)], |bin, [mean]| bins[bin][STEERING] = mean);
        self.gyro.means(|t| [shown.yaw_rate(t)], |bin, [mean]| bins[bin][GYRO] = mean);
        let (has_yaw, body) = (self.has_yaw, self.marker.inverse());
        self.reference.means(
            |t| {
                let marker = shown.reference(t);
                let pose = if has_yaw { marker.compose(&body) } else { marker };
                [pose.x, pose.y, pose.yaw]
            },
            |bin, mean| bins[bin][REFERENCE..].copy_from_slice(&mean),
        );
        bins
    }
}

/// What was recorded, as a thing that shows.
struct Recorded<'a> {
    binned: &'a Binned,
    next: [usize; 4],
}

impl<'a> Recorded<'a> {
    fn new(binned: &'a Binned) -> Self {
        let first = |begin: &[usize]| begin.first().copied().unwrap_or_default();
        Self {
            binned,
            next: [
                first(&binned.wheels.begin),
                first(&binned.steering.begin),
                first(&binned.gyro.begin),
                first(&binned.reference.begin),
            ],
        }
    }

    fn row<const N: usize>(&mut self, sensor: usize, series: &Series<N>) -> [f64; N] {
        let row = self.next[sensor];
        self.next[sensor] += 1;
        series.value[row]
    }
}

impl Shown for Recorded<'_> {
    fn rotation(&mut self, _: f64) -> [f64; 4] {
        self.row(0, &self.binned.wheels.series)
    }

    fn wheel_speed(&mut self, _: f64) -> [f64; 4] {
        self.row(0, &self.binned.wheels.series)
    }

    fn steering(&mut self, _: f64) -> f64 {
        self.row(1, &self.binned.steering.series)[0]
    }

    fn yaw_rate(&mut self, _: f64) -> f64 {
        self.row(2, &self.binned.gyro.series)[0]
    }

    fn reference(&mut self, _: f64) -> Pose {
        let [x, y, yaw] = self.row(3, &self.binned.reference.series);
        // The lever of a marker whose yaw is not known cannot be taken out; see `has_yaw`.
        Pose::new(x, y, yaw)
    }
}

/// A count as a number.
#[allow(clippy::cast_precision_loss)]
pub(crate) fn to_f64(count: usize) -> f64 {
    count as f64
}
