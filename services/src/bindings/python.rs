//! The layouts as a module of ctypes classes.

use core::fmt::Write;

use kerbside_messages::layout::{Enumeration, Field, Kind, Layout};
use kerbside_messages::pins::{enumerations, layouts, schema_hash};
use kerbside_messages::topics::TABLE;
use kerbside_messages::{LAYOUT_VERSION, WHEELS};

use super::{prose, screaming};

/// The whole module.
#[must_use]
pub fn module() -> String {
    let mut out = String::from(BEGIN);
    let _ = writeln!(out, "# Version of all layouts; every type name ends with it.");
    let _ = writeln!(out, "LAYOUT_VERSION = {LAYOUT_VERSION}\n");
    let _ = writeln!(out, "# The order of the wheels in every array; bit i of a mask is wheel i.");
    let _ = writeln!(out, "WHEELS = ({})", quoted(&WHEELS));
    enumerations().into_iter().for_each(|one| enumeration(&mut out, one));
    layouts().into_iter().for_each(|one| structure(&mut out, one));
    topics(&mut out);
    out.push_str(FUNCTIONS);
    out
}

fn quoted(words: &[&str]) -> String {
    words.iter().map(|word| format!("{word:?}")).collect::<Vec<_>>().join(", ")
}

fn enumeration(out: &mut String, enumeration: &Enumeration) {
    let doc = prose(enumeration.doc);
    let _ = writeln!(out, "\n\nclass {}(enum.IntEnum):\n    \"\"\"{doc}\"\"\"\n", enumeration.name);
    for variant in enumeration.variants {
        let _ = writeln!(
            out,
            "    {} = {}  # {}",
            screaming(variant.name),
            variant.code,
            variant.words
        );
    }
}

fn structure(out: &mut String, layout: &Layout) {
    let name = layout.name;
    let _ = writeln!(
        out,
        "\n\nclass {name}(ctypes.Structure):\n    \"\"\"{}\"\"\"\n",
        prose(layout.doc)
    );
    out.push_str("    _fields_ = [\n");
    for field in layout.fields {
        let _ = writeln!(
            out,
            "        (\"{}\", {}),  # {}",
            field.name,
            element(field),
            prose(field.doc)
        );
    }
    let _ = writeln!(out, "    ]\n\n    @staticmethod\n    def type_name():");
    let _ = writeln!(out, "        \"\"\"Name of the type in shared memory.\"\"\"");
    let _ = writeln!(out, "        return \"kerbside.{name}.v{LAYOUT_VERSION}\"\n");
    let _ = writeln!(out, "\n_hold({name}, {})", layout.size);
}

fn element(field: &Field) -> String {
    let one = match field.kind {
        Kind::U8 => "ctypes.c_uint8",
        Kind::I8 => "ctypes.c_int8",
        Kind::U16 => "ctypes.c_uint16",
        Kind::U32 => "ctypes.c_uint32",
        Kind::U64 => "ctypes.c_uint64",
        Kind::I64 => "ctypes.c_int64",
        Kind::F64 => "ctypes.c_double",
        Kind::Nested(part) => part.name,
    };
    field.count.map_or(one.to_owned(), |count| format!("{one} * {count}"))
}

fn topics(out: &mut String) {
    out.push_str(TOPICS);
    for topic in TABLE {
        let _ = writeln!(
            out,
            "    \"{}\": Topic(\"{}\", {}, {}, {}, {}, 0x{:016x}),  # {}",
            topic.name,
            topic.name,
            topic.id,
            topic.payload,
            if topic.protected { "True" } else { "False" },
            if topic.wakes.is_some() { "True" } else { "False" },
            schema_hash(topic),
            topic.doc
        );
    }
    out.push_str("}\n");
}

const BEGIN: &str = r#""""The messages of kerbside as ctypes classes. Written by `kerbside bindings python`: do not edit.

Every message lies in shared memory as it stands here: little-endian, without unnamed padding. SI units, radians,
nanoseconds of the monotonic clock (`time.monotonic_ns`). Fields named `reserved` are zero.
"""

import ctypes
import enum
import time
import typing
import zlib


def _hold(layout, size):
    """Refuses a machine on which a class has another size than in shared memory."""
    if ctypes.sizeof(layout) != size:
        raise ImportError(f"{layout.__name__} has {ctypes.sizeof(layout)} bytes here, and {size} in shared memory")


"#;

const TOPICS: &str = r#"

class Topic(typing.NamedTuple):
    """A line of the table of topics."""

    name: str  # of the service; heartbeats have one per process: "heartbeat/tracker"
    number: int  # as headers carry it
    payload: type
    protected: bool  # whether samples carry a check sum
    wakes: bool  # whether an event of the same name wakes who reads it
    schema: int  # hash of the layout


TOPICS = {
"#;

const FUNCTIONS: &str = r#"

def check_sum(message, tail=b""):
    """CRC-32 of a message and of what follows it (a plan's points), the check sum's own field left out."""
    content = bytes(message)
    after = Header.check_sum.offset + Header.check_sum.size
    crc = zlib.crc32(content[: Header.check_sum.offset])
    return zlib.crc32(bytes(tail), zlib.crc32(content[after:], crc))


def seal(topic, message, epoch, sequence, tail=b""):
    """Fills in what the sender adds to a header.

    `epoch` is one number per life of the publisher, greater than that of any earlier life: the monotonic clock at its
    start. `sequence` counts its samples from 1. The sender sets `header.stamp` before: when the content was true.
    """
    header = message.header
    header.version = LAYOUT_VERSION
    header.topic = topic.number
    header.epoch = epoch
    header.sequence = sequence
    header.sent = time.monotonic_ns()
    header.check_sum = 0
    if topic.protected:
        header.check_sum = check_sum(message, tail)


def verify(topic, message, tail=b""):
    """Raises ValueError where a received message is not what was sent, or of another version."""
    header = message.header
    if header.version != LAYOUT_VERSION:
        raise ValueError(f"{topic.name}: layout version {header.version}, ours is {LAYOUT_VERSION}")
    if header.topic != topic.number:
        raise ValueError(f"{topic.name}: a sample of topic number {header.topic}")
    if topic.protected and header.check_sum != check_sum(message, tail):
        raise ValueError(f"{topic.name}: check sum does not match")


def text(field):
    """The text in an array of bytes: UTF-8, filled up with zeros."""
    return bytes(field).split(b"\0", 1)[0].decode(errors="replace")


def set_text(field, words):
    """Writes a text into an array of bytes, cut between characters where it is longer."""
    content = words.encode()[: len(field)].decode(errors="ignore").encode()
    field[:] = content.ljust(len(field), b"\0")
"#;
