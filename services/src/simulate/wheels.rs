//! How the wheels of a recorded run turned.

use kerbside_calibration::Series;
use kerbside_geometry::{Vehicle, WHEELS};
use kerbside_recordings::run_folder::Run;

/// Rotation of fl, fr, rl, rr since their first reading, as shown \[rad\]; none of wheels that were not read or of whose
/// encoder nothing is known.
pub(super) fn rotations(recorded: &Run, vehicle: &Vehicle) -> [Option<Series>; 4] {
    WHEELS.map(|wheel| {
        let index = wheel.index();
        let read = |mask: u8| mask & (1 << index) != 0;
        if let Some(table) = &recorded.encoders {
            let encoders = vehicle.encoders?;
            let per_revolution = encoders.counts_per_revolution[index]?;
            let rows = table.rows.iter().filter(|row| read(row.mask));
            let (t, counts): (Vec<f64>, Vec<i64>) =
                rows.map(|row| (row.t, row.counts[index])).unzip();
            let bits = encoders.counter_bits;
            let rotation = |t| Series::from_wrapping_counts(t, &counts, bits, per_revolution);
            return (!t.is_empty()).then(|| rotation(t));
        }
        let rows = recorded.wheels.iter().flat_map(|table| &table.rows);
        let rows = rows.filter(|row| read(row.mask));
        let (t, speeds): (Vec<f64>, Vec<f64>) = rows.map(|row| (row.t, row.speeds[index])).unzip();
        let used = vehicle.speed_radius[index].unwrap_or(vehicle.radius[index]);
        (!t.is_empty()).then(|| Series::from_speeds(t, &speeds, used))
    })
}

/// When the first wheel has rolled so far that nobody takes it for standing: a hundredth of the wheelbase \[s\].
pub(super) fn first_motion(rotations: &[Option<Series>; 4], vehicle: &Vehicle) -> Option<f64> {
    let moved = |(series, radius): (&Option<Series>, f64)| {
        let series = series.as_ref()?;
        let first = series.value.first()?;
        let far = |value: &f64| (value - first).abs() * radius > 0.01 * vehicle.wheelbase;
        let at = series.value.iter().position(far)?;
        series.t.get(at).copied()
    };
    rotations.iter().zip(vehicle.radius).filter_map(moved).reduce(f64::min)
}
