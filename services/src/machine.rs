//! What is known of the machine, for reports.

use std::fs;
use std::time::{SystemTime, UNIX_EPOCH};

/// Facts as (name, value); what cannot be read is left out.
#[must_use]
pub fn facts() -> Vec<(String, String)> {
    let cores = std::thread::available_parallelism().ok().map(|cores| cores.to_string());
    let kernel = fs::read_to_string("/proc/sys/kernel/osrelease").ok();
    let processor = fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| model_name(&text));
    [("Cores", cores), ("Processor", processor), ("Kernel", kernel)]
        .into_iter()
        .filter_map(|(name, value)| Some((name.to_owned(), value?.trim().to_owned())))
        .collect()
}

fn model_name(cpuinfo: &str) -> Option<String> {
    let line = cpuinfo.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// The day, as year-month-day (UTC).
#[must_use]
pub fn date() -> String {
    let passed = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |passed| passed.as_secs());
    let [year, month, day] = civil(i64::try_from(passed / 86_400).unwrap_or_default());
    format!("{year:04}-{month:02}-{day:02}")
}

/// Year, month and day of the Gregorian calendar, so many days after 1970-01-01 (E. G. Richards, "Calendars", in the
/// Explanatory Supplement to the Astronomical Almanac, 3rd edition, section 15.11).
fn civil(days: i64) -> [i64; 3] {
    let julian = days + 2_440_588;
    let f = julian + 1401 + (4 * julian + 274_277) / 146_097 * 3 / 4 - 38;
    let e = 4 * f + 3;
    let h = 5 * (e % 1461 / 4) + 2;
    let month = (h / 153 + 2) % 12 + 1;
    [e / 1461 - 4716 + (14 - month) / 12, month, h % 153 / 5 + 1]
}

#[cfg(test)]
mod tests {
    use super::civil;

    #[test]
    fn days_have_their_dates() {
        let dates = [0, 59, 11_016, 19_782, 20_785].map(civil);
        let expected = [[1970, 1, 1], [1970, 3, 1], [2000, 2, 29], [2024, 2, 29], [2026, 11, 28]];
        assert_eq!(dates, expected);
    }
}
