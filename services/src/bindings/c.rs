//! The layouts as a header of C99.

use core::fmt::Write;

use kerbside_messages::layout::{Enumeration, Field, Kind, Layout};
use kerbside_messages::pins::{enumerations, layouts, schema_hash};
use kerbside_messages::topics::{TABLE, type_name_of};
use kerbside_messages::{LAYOUT_VERSION, TrajectoryPoint, WHEELS};

use super::{prose, screaming, snake};

/// The whole header.
#[must_use]
pub fn header() -> String {
    let mut out = String::from(BEGIN);
    let _ = writeln!(
        out,
        "/* Version of all layouts; every type name ends with it. */\n#define KERBSIDE_LAYOUT_VERSION {LAYOUT_VERSION}u\n"
    );
    wheels(&mut out);
    enumerations().into_iter().for_each(|one| enumeration(&mut out, one));
    layouts().into_iter().for_each(|one| structure(&mut out, one));
    topics(&mut out);
    out.push_str(FUNCTIONS);
    out
}

fn wheels(out: &mut String) {
    out.push_str("/* The order of the wheels in every array, and their bits in every mask. */\n");
    for (index, wheel) in WHEELS.iter().enumerate() {
        let name = screaming(wheel);
        let _ = writeln!(out, "#define KERBSIDE_WHEEL_{name} {index}");
        let _ = writeln!(out, "#define KERBSIDE_WHEEL_{name}_MASK 0x{:x}u", 1 << index);
    }
}

fn enumeration(out: &mut String, enumeration: &Enumeration) {
    let name = screaming(enumeration.name);
    let _ = writeln!(
        out,
        "\n/* {} */\nenum kerbside_{} {{",
        prose(enumeration.doc),
        snake(enumeration.name)
    );
    for (index, variant) in enumeration.variants.iter().enumerate() {
        let comma = if index + 1 < enumeration.variants.len() { "," } else { "" };
        let variant_name = screaming(variant.name);
        let _ = writeln!(
            out,
            "    KERBSIDE_{name}_{variant_name} = {}{comma} /* {} */",
            variant.code, variant.words
        );
    }
    out.push_str("};\n");
}

fn structure(out: &mut String, layout: &Layout) {
    let name = snake(layout.name);
    let _ = writeln!(out, "\n/* {} */\ntypedef struct kerbside_{name} {{", prose(layout.doc));
    for field in layout.fields {
        let count = field.count.map(|count| format!("[{count}]")).unwrap_or_default();
        let _ = writeln!(
            out,
            "    {} {}{count}; /* {} */",
            element(field),
            field.name,
            prose(field.doc)
        );
    }
    let _ = writeln!(out, "}} kerbside_{name};");
    let _ =
        writeln!(out, "KERBSIDE_ASSERT({name}_size, sizeof(kerbside_{name}) == {});", layout.size);
}

fn element(field: &Field) -> String {
    match field.kind {
        Kind::U8 => "uint8_t".to_owned(),
        Kind::I8 => "int8_t".to_owned(),
        Kind::U16 => "uint16_t".to_owned(),
        Kind::U32 => "uint32_t".to_owned(),
        Kind::U64 => "uint64_t".to_owned(),
        Kind::I64 => "int64_t".to_owned(),
        Kind::F64 => "double".to_owned(),
        Kind::Nested(part) => format!("kerbside_{}", snake(part.name)),
    }
}

fn topics(out: &mut String) {
    out.push_str(
        "\n/* Topics: the number in headers, the name of the service, the name of the payload's type, whether samples\n   carry a check sum, and the hash of the layout. Heartbeats have a service per process: \"heartbeat/tracker\". */\n",
    );
    for topic in TABLE {
        let name = screaming(topic.name);
        let _ = writeln!(out, "\n/* {} Payload: kerbside_{}. */", topic.doc, snake(topic.payload));
        let _ = writeln!(out, "#define KERBSIDE_TOPIC_{name} {}u", topic.id);
        let _ = writeln!(out, "#define KERBSIDE_SERVICE_{name} \"{}\"", topic.name);
        let type_name = type_name_of(topic).unwrap_or_default();
        let _ = writeln!(out, "#define KERBSIDE_TYPE_{name} \"{type_name}\"");
        let _ = writeln!(out, "#define KERBSIDE_PROTECTED_{name} {}", u8::from(topic.protected));
        let _ =
            writeln!(out, "#define KERBSIDE_SCHEMA_{name} UINT64_C(0x{:016x})", schema_hash(topic));
    }
    let _ = writeln!(
        out,
        "\n/* What follows a plan's head. */\n#define KERBSIDE_TYPE_TRAJECTORY_POINT \"{}\"",
        TrajectoryPoint::TYPE_NAME
    );
}

const BEGIN: &str = r"/* The messages of kerbside, for C99 and C++11. Written by `kerbside bindings c`: do not edit.
 *
 * Every message lies in shared memory as it stands here: little-endian, without unnamed padding. SI units, radians,
 * nanoseconds of the monotonic clock. Fields named `reserved` are zero.
 */
#ifndef KERBSIDE_MESSAGES_H
#define KERBSIDE_MESSAGES_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define KERBSIDE_ASSERT(name, condition) static_assert(condition, #name)
#else
#define KERBSIDE_ASSERT(name, condition) typedef char kerbside_assert_##name[(condition) ? 1 : -1]
#endif

";

const FUNCTIONS: &str = r"
/* CRC-32 (IEEE 802.3) of `size` bytes, going on from `crc`; begin with 0. */
static inline uint32_t kerbside_crc32(uint32_t crc, const void *bytes, size_t size)
{
    const uint8_t *next = (const uint8_t *)bytes;
    crc = ~crc;
    while (size-- > 0) {
        int bit;
        crc ^= *next++;
        for (bit = 0; bit < 8; ++bit) {
            crc = (crc >> 1) ^ (0xedb88320u & (0u - (crc & 1u)));
        }
    }
    return ~crc;
}

/* The check sum of a message and of what follows it (a plan's points; else none): over all bytes but its own field. */
static inline uint32_t kerbside_check_sum(const void *message, size_t size, const void *tail, size_t tail_size)
{
    const size_t field = offsetof(kerbside_header, check_sum);
    const size_t after = field + sizeof(uint32_t);
    const uint8_t *bytes = (const uint8_t *)message;
    uint32_t crc = kerbside_crc32(0, bytes, field);
    crc = kerbside_crc32(crc, bytes + after, size - after);
    return tail_size == 0 ? crc : kerbside_crc32(crc, tail, tail_size);
}

/* Fills in what the sender adds to a header. `epoch` is one number per life of the publisher, greater than that of any
 * earlier life: the monotonic clock at its start. `sequence` counts its samples from 1. `sent` is the monotonic clock
 * now. `protect` is the topic's KERBSIDE_PROTECTED. The sender sets `stamp` before: when the content was true. */
static inline void kerbside_seal(void *message, size_t size, const void *tail, size_t tail_size, uint16_t topic,
                                 int protect, uint64_t epoch, uint64_t sequence, uint64_t sent)
{
    kerbside_header *header = (kerbside_header *)message;
    header->version = KERBSIDE_LAYOUT_VERSION;
    header->topic = topic;
    header->epoch = epoch;
    header->sequence = sequence;
    header->sent = sent;
    header->check_sum = 0;
    if (protect) {
        header->check_sum = kerbside_check_sum(message, size, tail, tail_size);
    }
}

/* Whether a received message is what was sent, and of this version: 1 or 0. */
static inline int kerbside_verify(const void *message, size_t size, const void *tail, size_t tail_size, uint16_t topic,
                                  int protect)
{
    const kerbside_header *header = (const kerbside_header *)message;
    return header->version == KERBSIDE_LAYOUT_VERSION && header->topic == topic &&
           (!protect || header->check_sum == kerbside_check_sum(message, size, tail, tail_size));
}

#endif
";
