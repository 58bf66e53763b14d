//! Logging: structured events on standard error, one line each, readable together whichever process wrote them.

use std::io::IsTerminal;

use kerbside_messages::seconds;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::FormatTime;

/// Writes the monotonic time, which all processes share, and the process's name.
struct Stamp(&'static str);

impl FormatTime for Stamp {
    fn format_time(&self, writer: &mut Writer<'_>) -> core::fmt::Result {
        write!(writer, "{:12.6} {:>10}", seconds(kerbside_runtime::now()), self.0)
    }
}

/// Starts logging for the process `name`: at `level` unless RUST_LOG says otherwise, as JSON where `json`.
pub fn start(name: &'static str, level: &str, json: bool) {
    let filter = EnvFilter::try_from_default_env()
        .or_else(|_| EnvFilter::try_new(level))
        .unwrap_or_else(|_| EnvFilter::new("info"));
    let builder = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_timer(Stamp(name))
        .with_target(false)
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(std::io::stderr);
    // A second start in one process (tests) keeps the first.
    let _ = if json { builder.json().try_init() } else { builder.try_init() };
    kerbside_runtime::quieten_middleware_log();
}
