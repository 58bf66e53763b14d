//! Schemas made from layouts: ROS 2 message definitions, whose CDR encoding is the memory itself.
//!
//! The layouts have no unnamed padding and every field is aligned to its own size, so the little-endian CDR of a
//! message is its bytes behind a four-byte header. A plan's points follow as a CDR sequence.

use core::fmt::Write;

use crate::layout::{Described, Kind, Layout};
use crate::topics::{Topic, layout_of};
use crate::{Plan, TrajectoryPoint};

/// The four bytes before a little-endian CDR message.
pub const CDR_HEADER: [u8; 4] = [0, 1, 0, 0];

/// The layout of the elements that follow a topic's payload, where any do.
#[must_use]
pub fn tail_of(topic: &Topic) -> Option<&'static Layout> {
    (topic.payload == Plan::LAYOUT.name).then_some(TrajectoryPoint::LAYOUT)
}

/// Name of the payload's schema in recordings.
#[must_use]
pub fn schema_name(topic: &Topic) -> String {
    format!("kerbside/msg/{}", topic.payload)
}

/// The payload's definition in the language of ROS 2 messages, nested definitions included.
#[must_use]
pub fn ros_definition(topic: &Topic) -> String {
    let Some(layout) = layout_of(topic) else { return String::new() };
    let mut nested = Vec::new();
    let mut text = fields_of(layout, &mut nested);
    if let Some(tail) = tail_of(topic) {
        let _ = writeln!(text, "{}[] trajectory", tail.name);
        note(&mut nested, tail);
    }
    let mut next = 0;
    while next < nested.len() {
        let part = nested[next];
        let body = fields_of(part, &mut nested);
        let _ = write!(text, "{}\nMSG: kerbside/{}\n{body}", "=".repeat(80), part.name);
        next += 1;
    }
    text
}

fn note(nested: &mut Vec<&'static Layout>, layout: &'static Layout) {
    if !nested.iter().any(|known| known.name == layout.name) {
        nested.push(layout);
    }
}

fn fields_of(layout: &Layout, nested: &mut Vec<&'static Layout>) -> String {
    let mut text = String::new();
    for field in layout.fields {
        let kind = match field.kind {
            Kind::U8 => "uint8",
            Kind::I8 => "int8",
            Kind::U16 => "uint16",
            Kind::U32 => "uint32",
            Kind::U64 => "uint64",
            Kind::I64 => "int64",
            Kind::F64 => "float64",
            Kind::Nested(part) => {
                note(nested, part);
                part.name
            }
        };
        let count = field.count.map(|count| format!("[{count}]")).unwrap_or_default();
        let doc = field.doc.trim().replace("\\[", "[").replace("\\]", "]");
        let _ = writeln!(text, "{kind}{count} {} # {doc}", field.name);
    }
    text
}

/// A message as CDR: header, bytes, and the sequence that follows, where one does.
pub fn encode_cdr(topic: &Topic, message: &[u8], tail: &[u8], out: &mut Vec<u8>) {
    out.extend_from_slice(&CDR_HEADER);
    out.extend_from_slice(message);
    if let Some(element) = tail_of(topic) {
        let count = u32::try_from(tail.len() / element.size).unwrap_or(u32::MAX);
        out.extend_from_slice(&count.to_le_bytes());
        while !(out.len() - CDR_HEADER.len()).is_multiple_of(8) {
            out.push(0);
        }
        out.extend_from_slice(tail);
    }
}

/// The message's bytes and those that follow it, from CDR; none where the length does not fit.
#[must_use]
pub fn decode_cdr<'a>(topic: &Topic, cdr: &'a [u8]) -> Option<(&'a [u8], &'a [u8])> {
    let body = cdr.strip_prefix(&CDR_HEADER)?;
    let size = layout_of(topic)?.size;
    let (message, rest) = body.split_at_checked(size)?;
    let Some(element) = tail_of(topic) else { return rest.is_empty().then_some((message, rest)) };
    let (count, _) = rest.split_first_chunk::<4>()?;
    let count = u32::from_le_bytes(*count) as usize;
    let tail = rest.get((size + 4).next_multiple_of(8) - size..)?;
    (tail.len() == count.checked_mul(element.size)?).then_some((message, tail))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topics::TABLE;

    #[test]
    fn layouts_have_no_gap_and_cdr_alignment() {
        fn alignment(kind: Kind) -> usize {
            match kind {
                Kind::Nested(part) => {
                    part.fields.iter().map(|field| alignment(field.kind)).max().unwrap_or(1)
                }
                other => other.size(),
            }
        }
        fn check(layout: &Layout) {
            let mut end = 0;
            for field in layout.fields {
                assert_eq!(field.offset, end, "{}.{}", layout.name, field.name);
                assert_eq!(
                    field.offset % alignment(field.kind),
                    0,
                    "{}.{}",
                    layout.name,
                    field.name
                );
                end += field.kind.size() * field.count.unwrap_or(1);
                if let Kind::Nested(part) = field.kind {
                    check(part);
                }
            }
            assert_eq!(end, layout.size, "{}", layout.name);
        }
        for topic in TABLE {
            check(layout_of(topic).unwrap());
        }
    }

    #[test]
    fn the_table_numbers_and_names_each_topic_once() {
        for (index, topic) in TABLE.iter().enumerate() {
            assert_eq!(usize::from(topic.id), index + 1);
            assert!(TABLE[..index].iter().all(|other| other.name != topic.name));
            assert!(ros_definition(topic).contains("Header header"));
        }
    }

    #[test]
    fn a_plan_comes_back_from_cdr() {
        let points = [TrajectoryPoint { x: 1.0, ..Default::default() }; 3];
        let plan = Plan { points: 3, ..Default::default() };
        let mut cdr = Vec::new();
        encode_cdr(
            &crate::topics::PLAN,
            bytemuck::bytes_of(&plan),
            bytemuck::cast_slice(&points),
            &mut cdr,
        );
        let (message, tail) = decode_cdr(&crate::topics::PLAN, &cdr).unwrap();
        assert_eq!(message, bytemuck::bytes_of(&plan));
        assert_eq!(tail, bytemuck::cast_slice::<_, u8>(&points));
        assert!(decode_cdr(&crate::topics::PLAN, &cdr[..cdr.len() - 1]).is_none());
    }
}
