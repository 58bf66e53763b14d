//! What a person sees while the car parks: one line on a terminal, nothing in a pipe.

use std::io::IsTerminal;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kerbside_geometry::angle;

use super::trace::Trace;

/// The live line.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A line on standard error, unless `headless` or no terminal is there.
    #[must_use]
    pub fn new(headless: bool) -> Self {
        let bar = ProgressBar::new_spinner();
        if headless || !std::io::stderr().is_terminal() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        if let Ok(style) = ProgressStyle::with_template("{spinner} {wide_msg}") {
            bar.set_style(style);
        }
        Self { bar }
    }

    /// Shows where the manoeuvre is.
    pub fn show(&self, phase: &str, trace: &Trace) {
        if self.bar.is_hidden() {
            return;
        }
        self.bar.set_message(line(phase, trace));
        self.bar.tick();
    }

    /// Says something that stays, above the line.
    pub fn say(&self, text: &str) {
        self.bar.println(text);
    }

    /// Takes the line away.
    pub fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

/// The line itself: at most 78 characters, so that it fits an ordinary terminal.
fn line(phase: &str, trace: &Trace) -> String {
    let Some(odometry) = trace.odometry.last() else { return phase.to_owned() };
    let pose = format!(
        "x {:6.2} y {:5.2} yaw {:6.1}°",
        odometry.x,
        odometry.y,
        angle::degrees(odometry.yaw)
    );
    let goal = trace
        .commands
        .last()
        .map_or(String::new(), |command| format!("  goal {:5.2} m", command.to_goal));
    let latency = match trace.latency.len() {
        0 => String::new(),
        _ => format!("  p50 {} µs", trace.latency.value_at_quantile(0.5)),
    };
    format!("{phase}  {pose}{goal}{latency}  misses {}", trace.misses())
}
