//! Logging: structured events on standard error, one line each, readable together whichever process wrote them.

use core::fmt;
use std::io::IsTerminal;

use kerbside_messages::seconds;
use serde_json::{Map, Value, json};
use tracing::field::{Field, Visit};
use tracing::{Event, Subscriber};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::format::{FormatEvent, FormatFields, Writer};
use tracing_subscriber::fmt::time::FormatTime;
use tracing_subscriber::fmt::{FmtContext, MakeWriter};
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;

/// Starts logging for the process `name`: at `level` unless RUST_LOG says otherwise, as JSON where `json`.
pub fn start(name: &'static str, level: &str, json: bool) {
    let stderr = std::io::stderr;
    // A second start in one process (tests) keeps the first.
    let _ = if json {
        to(stderr, level).event_format(JsonLines(name)).finish().try_init()
    } else {
        let builder = to(stderr, level).with_timer(Stamp(name)).with_target(false);
        builder.with_ansi(std::io::stderr().is_terminal()).finish().try_init()
    };
    kerbside_runtime::quieten_middleware_log();
}

type Builder<W> = tracing_subscriber::fmt::SubscriberBuilder<
    tracing_subscriber::fmt::format::DefaultFields,
    tracing_subscriber::fmt::format::Format,
    EnvFilter,
    W,
>;

fn to<W: for<'a> MakeWriter<'a> + 'static>(writer: W, level: &str) -> Builder<W> {
    let filter = EnvFilter::try_from_default_env()
        .or_else(|_| EnvFilter::try_new(level))
        .unwrap_or_else(|_| EnvFilter::new("info"));
    // An error of writing would be told by a panic. A car does not stop because nobody reads its log.
    tracing_subscriber::fmt().log_internal_errors(false).with_env_filter(filter).with_writer(writer)
}

/// Writes the monotonic time, which all processes share, and the process's name.
struct Stamp(&'static str);

impl FormatTime for Stamp {
    fn format_time(&self, writer: &mut Writer<'_>) -> fmt::Result {
        write!(writer, "{:12.6} {:>10}", seconds(kerbside_runtime::now()), self.0)
    }
}

/// Writes one JSON object a line: monotonic time \[s\], process, level, message, and the event's own fields below
/// `fields`, so that none of them hides another.
struct JsonLines(&'static str);

impl<S, N> FormatEvent<S, N> for JsonLines
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(
        &self,
        _: &FmtContext<'_, S, N>,
        mut writer: Writer<'_>,
        event: &Event<'_>,
    ) -> fmt::Result {
        let mut fields = Fields::default();
        event.record(&mut fields);
        let line = json!({
            "time": seconds(kerbside_runtime::now()),
            "process": self.0,
            "level": event.metadata().level().as_str().to_ascii_lowercase(),
            "message": fields.0.remove("message"),
            "fields": fields.0,
        });
        writeln!(writer, "{line}")
    }
}

/// An event's fields.
#[derive(Default)]
struct Fields(Map<String, Value>);

impl Fields {
    fn put(&mut self, field: &Field, value: impl Into<Value>) {
        self.0.insert(field.name().to_owned(), value.into());
    }
}

impl Visit for Fields {
    fn record_f64(&mut self, field: &Field, value: f64) {
        self.put(field, value);
    }

    fn record_i64(&mut self, field: &Field, value: i64) {
        self.put(field, value);
    }

    fn record_u64(&mut self, field: &Field, value: u64) {
        self.put(field, value);
    }

    fn record_bool(&mut self, field: &Field, value: bool) {
        self.put(field, value);
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        self.put(field, value);
    }

    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        self.put(field, format!("{value:?}"));
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::sync::{Arc, Mutex};

    use super::*;

    #[derive(Clone, Default)]
    struct Kept(Arc<Mutex<Vec<u8>>>);

    impl Write for Kept {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_line_of_json_holds_everything_once() {
        let kept = Kept::default();
        let writer = kept.clone();
        let subscriber =
            to(move || writer.clone(), "info").event_format(JsonLines("supervisor")).finish();
        tracing::subscriber::with_default(subscriber, || {
            tracing::info!(process = "ingest", pid = 7_u32, late = 0.5, ok = true, "started");
            tracing::debug!("not at this level");
        });
        let text = String::from_utf8(kept.0.lock().unwrap().clone()).unwrap();
        let line: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(line["process"], "supervisor");
        assert_eq!((&line["level"], &line["message"]), (&json!("info"), &json!("started")));
        let fields = json!({ "process": "ingest", "pid": 7, "late": 0.5, "ok": true });
        assert_eq!(line["fields"], fields);
        assert!(line["time"].as_f64().unwrap() > 0.0);
    }
}
