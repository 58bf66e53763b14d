//! Keys of what surrounds the stages: interface, scheduling, recording, logging, processes.

use kerbside_messages::Process;

use super::StackDraft;
use crate::declare::{Kind, Schema};
use crate::stack::{Compression, InterfaceKind, LogFormat, LogLevel, RealtimeMode, Start};

/// Sizes of recordings: from much more than their schemas take to 1 TB.
const BYTES: Kind = Kind::Integer { unit: "byte", low: 1_000_000, high: 1_000_000_000_000 };
const CORE: Kind = Kind::Integer { unit: "", low: 0, high: 1023 };

/// `[interface]`, `[line]`, `[realtime]`, `[recorder]`, `[log]` and `[process]`.
pub(super) fn declare(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    let schema = declare_recorder(declare_realtime(declare_interface(schema)));
    declare_processes(declare_log(schema))
}

fn declare_interface(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section("interface", "What the vehicle is reached through.")
        .key(
            "interface.kind",
            Kind::Choice(InterfaceKind::NAMES),
            "The serial line to a vehicle, or a recording that is played to the stack.",
            |s| &mut s.interface,
        )
        .section("line", "The serial line to the vehicle.")
        .optional(
            "line.device",
            Kind::Text,
            "the simulated vehicle of the same instance",
            "The serial device, relative to this file unless it begins with a slash.",
            |s| &mut s.device,
        )
        .key(
            "line.baud",
            Kind::Integer { unit: "bit/s", low: 9600, high: 4_000_000 },
            "Speed of the line; 200 four-wheel readings a second take about 110,000.",
            |s| &mut s.baud,
        )
}

fn declare_realtime(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section("realtime", "Scheduling of the control path.")
        .key(
            "realtime.enabled",
            Kind::Choice(RealtimeMode::NAMES),
            "Real-time scheduling: where the rights are there, demanded, or not at all.",
            |s| &mut s.realtime.enabled,
        )
        .key(
            "realtime.priority",
            Kind::Integer { unit: "", low: 1, high: 99 },
            "Priority under SCHED_FIFO.",
            |s| &mut s.realtime.priority,
        )
        .key(
            "realtime.lock_memory",
            Kind::Flag,
            "Whether memory is locked, so that no page fault delays a step.",
            |s| &mut s.realtime.lock_memory,
        )
        .optional(
            "realtime.cores",
            Kind::List { of: &CORE, least: 1, most: 1024 },
            "the last core",
            "Cores that the control path runs on; a single one has the shorter tail.",
            |s| &mut s.realtime.cores,
        )
}

fn declare_recorder(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section("recorder", "Recording of every topic.")
        .key("recorder.enabled", Kind::Flag, "Whether anything is recorded.", |s| {
            &mut s.recorder.enabled
        })
        .optional(
            "recorder.folder",
            Kind::Text,
            "kerbside/recordings in the user's XDG state folder",
            "Folder of the recordings, relative to this file unless it begins with a slash.",
            |s| &mut s.recorder_folder,
        )
        .key(
            "recorder.chunk_size",
            Kind::Integer { unit: "byte", low: 4096, high: 67_108_864 },
            "Size of a chunk before compression; a recorder that is killed loses one at most.",
            |s| &mut s.recorder.chunk_size,
        )
        .key(
            "recorder.compression",
            Kind::Choice(Compression::NAMES),
            "Compression of chunks.",
            |s| &mut s.recorder.compression,
        )
        .key(
            "recorder.file_bytes",
            BYTES,
            "Size at which a recording is closed and the next one begun; one that --recording \
             names goes on as it is.",
            |s| &mut s.recorder.file_bytes,
        )
        .optional(
            "recorder.keep_bytes",
            BYTES,
            "no recording is removed for its size",
            "Most that the recordings of an instance take in the folder: the oldest are removed \
             where the next one begins. At least twice recorder.file_bytes.",
            |s| &mut s.recorder.keep_bytes,
        )
        .optional(
            "recorder.keep_days",
            Kind::Integer { unit: "day", low: 1, high: 36_500 },
            "no recording is removed for its age",
            "Recordings of the instance that were last written before so many days are removed \
             where the next one begins.",
            |s| &mut s.recorder.keep_days,
        )
}

fn declare_log(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section("log", "Logging.")
        .key(
            "log.level",
            Kind::Choice(LogLevel::NAMES),
            "Least severity that is logged; RUST_LOG overrides it.",
            |s| &mut s.log.level,
        )
        .key("log.format", Kind::Choice(LogFormat::NAMES), "Form of log lines.", |s| {
            &mut s.log.format
        })
}

/// A process is a line of the table of topics; its key here follows.
fn declare_processes(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    let mut schema = schema.section("process", "Who starts which process.");
    for (place, process) in Process::SUPERVISED.into_iter().enumerate() {
        schema = schema.key(
            format!("process.{process}.start"),
            Kind::Choice(Start::NAMES),
            format!(
                "Who starts the process {process}: the supervisor, which also ends and restarts \
                 it, or somebody else; then it is awaited and watched, never killed."
            ),
            move |s: &mut StackDraft| &mut s.start[place],
        );
    }
    schema
}
