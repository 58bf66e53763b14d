//! Every layout as text: what processes of one version agree about, byte for byte.
//!
//! `layouts.txt` beside this crate's manifest is this text as it was when the version was raised last; a test compares
//! the two. Bindings for other languages are made from the same lists.

use core::fmt::Write;

use crate::LAYOUT_VERSION;
use crate::layout::{Enumeration, Field, Kind, Layout, Meaning};
use crate::schema::tail_of;
use crate::topics::{TABLE, Topic, layout_of, type_name_of};

/// Every layout that a topic's payload is made of, each after those it contains.
#[must_use]
pub fn layouts() -> Vec<&'static Layout> {
    let mut found = Vec::new();
    for topic in TABLE {
        layout_of(topic).into_iter().chain(tail_of(topic)).for_each(|one| collect(one, &mut found));
    }
    found
}

fn collect(layout: &'static Layout, found: &mut Vec<&'static Layout>) {
    for field in layout.fields {
        if let Kind::Nested(part) = field.kind {
            collect(part, found);
        }
    }
    if !found.iter().any(|known| known.name == layout.name) {
        found.push(layout);
    }
}

/// Every enumeration that a field carries, in the order of the fields.
#[must_use]
pub fn enumerations() -> Vec<&'static Enumeration> {
    let mut found: Vec<&'static Enumeration> = Vec::new();
    for field in layouts().into_iter().flat_map(|layout| layout.fields) {
        if let Meaning::Code(one) = field.meaning
            && !found.iter().any(|known| known.name == one.name)
        {
            found.push(one);
        }
    }
    found
}

/// Name of a field's type, as Rust writes it.
#[must_use]
pub fn type_of(field: &Field) -> String {
    let element = match field.kind {
        Kind::U8 => "u8",
        Kind::I8 => "i8",
        Kind::U16 => "u16",
        Kind::U32 => "u32",
        Kind::U64 => "u64",
        Kind::I64 => "i64",
        Kind::F64 => "f64",
        Kind::Nested(part) => part.name,
    };
    match field.count {
        Some(count) => format!("[{element}; {count}]"),
        None => element.to_owned(),
    }
}

/// A number that two builds share where a topic's payload has the same fields of the same types in the same places:
/// FNV-1a, 64 bit, over the lines that describe them. What fields mean is not part of it.
#[must_use]
pub fn schema_hash(topic: &Topic) -> u64 {
    let mut parts = Vec::new();
    layout_of(topic).into_iter().chain(tail_of(topic)).for_each(|one| collect(one, &mut parts));
    let text: String = parts.into_iter().map(structure).collect();
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Everything, in blocks that an empty line parts: the version, topics, structures, enumerations.
#[must_use]
pub fn pinned() -> String {
    let mut text = format!("layout version {LAYOUT_VERSION}\n");
    let blocks = TABLE
        .iter()
        .map(topic)
        .chain(layouts().into_iter().map(structure))
        .chain(enumerations().into_iter().map(enumeration));
    for block in blocks {
        let _ = write!(text, "\n{block}");
    }
    text
}

fn topic(topic: &Topic) -> String {
    let (id, payload, hash) = (topic.id, topic.payload, schema_hash(topic));
    let name = type_name_of(topic).unwrap_or_default();
    let tail = tail_of(topic).map(|tail| format!("  followed by {}\n", tail.name));
    format!(
        "topic {}\n  number {id}\n  payload {payload}\n{}  type name {name}\n  schema {hash:016x}\n",
        topic.name,
        tail.unwrap_or_default(),
    )
}

fn structure(layout: &'static Layout) -> String {
    let mut text = format!(
        "struct {}\n  size {}, aligned to {}\n",
        layout.name, layout.size, layout.alignment
    );
    for field in layout.fields {
        let _ = writeln!(text, "  {:5}  {}: {}", field.offset, field.name, type_of(field));
    }
    text
}

fn enumeration(enumeration: &'static Enumeration) -> String {
    let mut text = format!("enum {}\n", enumeration.name);
    for variant in enumeration.variants {
        let _ = writeln!(text, "  {:5}  {}: {}", variant.code, variant.name, variant.words);
    }
    text
}
