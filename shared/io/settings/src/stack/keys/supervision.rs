//! Keys of supervision and gate.

use super::StackDraft;
use crate::declare::{Kind, Range, Schema};

const TIMEOUT: Kind = Kind::seconds(Range::from(0.001).to(60.0));
const PERIOD: Kind = Kind::seconds(Range::from(0.001).to(0.1));

/// `[safety]`, `[timeouts]` and `[restart]`.
pub(super) fn declare(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    declare_restart(declare_timeouts(declare_safety(schema)))
}

fn declare_safety(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section("safety", "What the vehicle must be able to do after any single fault.")
        .key(
            "safety.stop_distance",
            Kind::metres(Range::above(0.0).to(1000.0)),
            "Distance within which the vehicle must be able to stop from full speed after any \
             single fault. Refused unless limits.speed * (T + speed_delay + speed_lag) + \
             limits.speed^2 / (2 * limits.deceleration) is at most this, T being the longest of \
             freshness, permit and vehicle_silence plus one actuation_period.",
            |s| &mut s.safety.stop_distance,
        )
        .key("safety.cycle", PERIOD, "The supervisor's own cycle.", |s| &mut s.safety.cycle)
        .key(
            "safety.actuation_period",
            PERIOD,
            "The gate's own cycle, kept without commands.",
            |s| &mut s.safety.actuation_period,
        )
}

fn declare_timeouts(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section("timeouts", "How long each part waits before it takes silence for a fault.")
        .key(
            "timeouts.freshness",
            TIMEOUT,
            "Oldest sample of the control path that is acted on.",
            |s| &mut s.safety.timeouts.freshness,
        )
        .key("timeouts.permit", TIMEOUT, "Life of a permit.", |s| &mut s.safety.timeouts.permit)
        .key(
            "timeouts.vehicle_silence",
            TIMEOUT,
            "Silence after which the vehicle stops by itself.",
            |s| &mut s.safety.timeouts.vehicle_silence,
        )
        .key(
            "timeouts.line_silence",
            TIMEOUT,
            "Silence after which the line counts as lost and is opened again.",
            |s| &mut s.safety.timeouts.line_silence,
        )
        .key("timeouts.heartbeat", TIMEOUT, "Time between heartbeats.", |s| {
            &mut s.safety.timeouts.heartbeat
        })
        .key(
            "timeouts.heartbeat_window",
            TIMEOUT,
            "Window over which heartbeats are judged.",
            |s| &mut s.safety.timeouts.heartbeat_window,
        )
        .key(
            "timeouts.slow_window",
            TIMEOUT,
            "The same for planner and recorder, whose work comes in lumps.",
            |s| &mut s.safety.timeouts.slow_window,
        )
        .key(
            "timeouts.deadline",
            TIMEOUT,
            "Longest time from the arrival of a step's newest input to the step's end.",
            |s| &mut s.safety.timeouts.deadline,
        )
        .key(
            "timeouts.deadline_misses",
            Kind::Integer { unit: "", low: 1, high: 32 },
            "So many deadline misses within a second are a fault.",
            |s| &mut s.safety.timeouts.deadline_misses,
        )
        .key(
            "timeouts.supervisor_silence",
            TIMEOUT,
            "A process whose supervisor is silent for so long exits.",
            |s| &mut s.safety.timeouts.supervisor_silence,
        )
        .key(
            "timeouts.arm",
            Kind::seconds(Range::from(1.0).to(3600.0)),
            "An armed stack without a plan becomes ready again.",
            |s| &mut s.safety.timeouts.arm,
        )
}

fn declare_restart(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section("restart", "How dead processes come back.")
        .key("restart.backoff", TIMEOUT, "First pause before a restart; doubles with each.", |s| {
            &mut s.safety.restart.backoff
        })
        .key("restart.backoff_limit", TIMEOUT, "Longest pause before a restart.", |s| {
            &mut s.safety.restart.backoff_limit
        })
        .key(
            "restart.healthy",
            TIMEOUT,
            "A process healthy for so long starts over with the first pause.",
            |s| &mut s.safety.restart.healthy,
        )
        .key(
            "restart.deaths",
            Kind::Integer { unit: "", low: 1, high: 32 },
            "So many deaths of one process within deaths_window, and it is not started again.",
            |s| &mut s.safety.restart.deaths,
        )
        .key(
            "restart.deaths_window",
            Kind::seconds(Range::from(1.0).to(3600.0)),
            "Time over which deaths are counted.",
            |s| &mut s.safety.restart.deaths_window,
        )
}
