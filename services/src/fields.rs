//! Messages as JSON and back, field by field as their layouts say; the same names as in recordings.
//!
//! Numbers are numbers, texts are strings, parts are objects; an array of arrays is flat, as it lies in memory. What
//! fills a gap is left out. A number that is not finite is null.

use kerbside_messages::layout::{Field, Kind, Layout};
use kerbside_messages::text;
use serde_json::{Number, Value};

/// A value that does not fit its field.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{path}: found {found}, allowed is {allowed}")]
pub struct FieldError {
    /// Dotted name of the field, like `header.stamp`.
    pub path: String,
    /// What was found there.
    pub found: String,
    /// What is allowed there.
    pub allowed: String,
}

/// What becomes of a field that JSON states or leaves out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Must be there.
    Required,
    /// Zero where it is not.
    Optional,
    /// Is filled in by whoever reads; must not be there.
    FilledIn,
}

/// The message of `layout` in `bytes`, as an object; what lies behind the bytes' end is null.
#[must_use]
pub fn to_json(layout: &Layout, bytes: &[u8]) -> Value {
    let entry = |field: &Field| {
        let bytes = bytes.get(field.offset..).unwrap_or_default();
        (field.name.to_owned(), field_to_json(field, bytes))
    };
    Value::Object(layout.fields.iter().filter(|field| !field.is_reserved()).map(entry).collect())
}

fn field_to_json(field: &Field, bytes: &[u8]) -> Value {
    let size = field.kind.size();
    let Some(count) = field.count else { return element_to_json(field.kind, bytes) };
    let Some(bytes) = bytes.get(..count * size) else { return Value::Null };
    if field.is_text() {
        return Value::String(text::as_str(bytes).to_owned());
    }
    bytes.chunks_exact(size).map(|element| element_to_json(field.kind, element)).collect()
}

fn element_to_json(kind: Kind, bytes: &[u8]) -> Value {
    fn first<const N: usize>(bytes: &[u8]) -> Option<[u8; N]> {
        bytes.first_chunk().copied()
    }
    let value = match kind {
        Kind::U8 => first(bytes).map(u8::from_ne_bytes).map(Value::from),
        Kind::I8 => first(bytes).map(i8::from_ne_bytes).map(Value::from),
        Kind::U16 => first(bytes).map(u16::from_ne_bytes).map(Value::from),
        Kind::U32 => first(bytes).map(u32::from_ne_bytes).map(Value::from),
        Kind::U64 => first(bytes).map(u64::from_ne_bytes).map(Value::from),
        Kind::I64 => first(bytes).map(i64::from_ne_bytes).map(Value::from),
        Kind::F64 => first(bytes).map(f64::from_ne_bytes).map(Value::from),
        Kind::Nested(layout) => Some(to_json(layout, bytes)),
    };
    value.unwrap_or_default()
}

/// Writes the object `value` into `bytes`, which hold a message of `layout`, all zero; `presence` says of each dotted
/// path what is to be there.
///
/// # Errors
/// [`FieldError`] for the first field that is missing, unknown, or holds something else than its kind.
pub fn from_json(
    layout: &Layout,
    value: &Value,
    presence: &dyn Fn(&str) -> Presence,
    bytes: &mut [u8],
) -> Result<(), FieldError> {
    object_from_json(layout, value, "", presence, bytes)
}

fn object_from_json(
    layout: &Layout,
    value: &Value,
    at: &str,
    presence: &dyn Fn(&str) -> Presence,
    bytes: &mut [u8],
) -> Result<(), FieldError> {
    let dotted = |name: &str| if at.is_empty() { name.to_owned() } else { format!("{at}.{name}") };
    let Value::Object(entries) = value else {
        return Err(wrong(at, value, &format!("an object of {}", layout.name)));
    };
    if let Some(name) = entries.keys().find(|name| field_of(layout, name).is_none()) {
        let allowed: Vec<_> = fields_of(layout).map(|field| field.name).collect();
        return Err(FieldError {
            path: dotted(&cut(name)),
            found: "no field of that name".to_owned(),
            allowed: allowed.join(", "),
        });
    }
    for field in fields_of(layout) {
        let path = dotted(field.name);
        let given = entries.get(field.name);
        match (presence(&path), given) {
            (Presence::FilledIn, Some(value)) => {
                return Err(wrong(&path, value, "nothing: it is filled in"));
            }
            (Presence::Required, None) => {
                return Err(FieldError {
                    allowed: allowed(field),
                    found: "nothing".to_owned(),
                    path,
                });
            }
            (_, None) => {}
            (_, Some(value)) => {
                let room = bytes.get_mut(field.offset..).unwrap_or_default();
                field_from_json(field, value, &path, presence, room)?;
            }
        }
    }
    Ok(())
}

fn fields_of(layout: &Layout) -> impl Iterator<Item = &'static Field> {
    layout.fields.iter().filter(|field| !field.is_reserved())
}

fn field_of(layout: &Layout, name: &str) -> Option<&'static Field> {
    fields_of(layout).find(|field| field.name == name)
}

fn field_from_json(
    field: &Field,
    value: &Value,
    path: &str,
    presence: &dyn Fn(&str) -> Presence,
    bytes: &mut [u8],
) -> Result<(), FieldError> {
    let size = field.kind.size();
    let misfit = || wrong(path, value, &allowed(field));
    let Some(count) = field.count else {
        return element_from_json(field.kind, value, path, presence, bytes, &misfit);
    };
    let room = bytes.get_mut(..count * size).ok_or_else(misfit)?;
    if field.is_text() {
        let text = value.as_str().filter(|text| text.len() <= count && !text.contains('\0'));
        let text = text.ok_or_else(misfit)?;
        room[..text.len()].copy_from_slice(text.as_bytes());
        return Ok(());
    }
    let elements = value.as_array().filter(|elements| elements.len() == count);
    let elements = elements.ok_or_else(misfit)?;
    for (index, (element, room)) in elements.iter().zip(room.chunks_exact_mut(size)).enumerate() {
        let path = format!("{path}[{index}]");
        let misfit = || wrong(&path, element, &allowed_of(field.kind));
        element_from_json(field.kind, element, &path, presence, room, &misfit)?;
    }
    Ok(())
}

fn element_from_json(
    kind: Kind,
    value: &Value,
    path: &str,
    presence: &dyn Fn(&str) -> Presence,
    bytes: &mut [u8],
    misfit: &dyn Fn() -> FieldError,
) -> Result<(), FieldError> {
    if let Kind::Nested(layout) = kind {
        return object_from_json(layout, value, path, presence, bytes);
    }
    let number = value.as_number().ok_or_else(misfit)?;
    let pattern = pattern(kind, number).ok_or_else(misfit)?;
    let room = bytes.get_mut(..kind.size()).ok_or_else(misfit)?;
    room.copy_from_slice(&pattern[..room.len()]);
    Ok(())
}

/// The bytes of a number, filled up to eight; none where the kind cannot hold it.
fn pattern(kind: Kind, number: &Number) -> Option<[u8; 8]> {
    fn filled<const N: usize>(bytes: [u8; N]) -> [u8; 8] {
        let mut all = [0; 8];
        all[..N].copy_from_slice(&bytes);
        all
    }
    let unsigned = number.as_u64();
    let signed = number.as_i64();
    match kind {
        Kind::U8 => {
            unsigned.and_then(|value| Some(filled(u8::try_from(value).ok()?.to_ne_bytes())))
        }
        Kind::I8 => signed.and_then(|value| Some(filled(i8::try_from(value).ok()?.to_ne_bytes()))),
        Kind::U16 => {
            unsigned.and_then(|value| Some(filled(u16::try_from(value).ok()?.to_ne_bytes())))
        }
        Kind::U32 => {
            unsigned.and_then(|value| Some(filled(u32::try_from(value).ok()?.to_ne_bytes())))
        }
        Kind::U64 => unsigned.map(u64::to_ne_bytes),
        Kind::I64 => signed.map(i64::to_ne_bytes),
        Kind::F64 => number.as_f64().filter(|value| value.is_finite()).map(f64::to_ne_bytes),
        Kind::Nested(_) => None,
    }
}

fn wrong(path: &str, value: &Value, allowed: &str) -> FieldError {
    FieldError { path: path.to_owned(), found: shown(value), allowed: allowed.to_owned() }
}

/// A value in a few words, however much of it there is.
#[must_use]
pub fn shown(value: &Value) -> String {
    match value {
        Value::Array(elements) => format!("an array of {}", elements.len()),
        Value::Object(entries) => format!("an object of {}", entries.len()),
        Value::String(text) => format!("\"{}\"", cut(text)),
        other => other.to_string(),
    }
}

/// The beginning of a text that somebody else wrote.
#[must_use]
pub fn cut(text: &str) -> String {
    const MOST: usize = 40;
    let mut cut: String = text.chars().take(MOST).flat_map(char::escape_default).collect();
    if text.chars().nth(MOST).is_some() {
        cut.push_str("...");
    }
    cut
}

fn allowed(field: &Field) -> String {
    match field.count {
        Some(count) if field.is_text() => format!("a text of at most {count} bytes"),
        Some(count) => format!("an array of {count}, each {}", allowed_of(field.kind)),
        None => allowed_of(field.kind),
    }
}

fn allowed_of(kind: Kind) -> String {
    match kind {
        Kind::U8 => format!("an integer, 0 to {}", u8::MAX),
        Kind::I8 => format!("an integer, {} to {}", i8::MIN, i8::MAX),
        Kind::U16 => format!("an integer, 0 to {}", u16::MAX),
        Kind::U32 => format!("an integer, 0 to {}", u32::MAX),
        Kind::U64 => format!("an integer, 0 to {}", u64::MAX),
        Kind::I64 => format!("an integer, {} to {}", i64::MIN, i64::MAX),
        Kind::F64 => "a finite number".to_owned(),
        Kind::Nested(layout) => format!("an object of {}", layout.name),
    }
}

#[cfg(test)]
mod tests {
    use kerbside_messages::layout::Described;
    use kerbside_messages::topics::{TABLE, layout_of};
    use kerbside_messages::{Fix, Header, Mode, ProcessRow, State};
    use serde_json::json;

    use super::*;

    fn read<M: Described + bytemuck::Pod>(value: &Value) -> Result<M, FieldError> {
        let mut message = M::zeroed();
        let bytes = bytemuck::bytes_of_mut(&mut message);
        from_json(M::LAYOUT, value, &|_| Presence::Optional, bytes)?;
        Ok(message)
    }

    #[test]
    fn a_state_comes_back() {
        let mut state = State {
            header: Header { sequence: u64::MAX, ..Header::default() },
            mode: Mode::Driving.code(),
            text: text::from_str("l\u{e4}uft"),
            rows: 1,
            ..State::default()
        };
        state.processes[0] =
            ProcessRow { pid: 7, waiting_for: text::from_str("x"), ..state.processes[0] };
        let json = to_json(State::LAYOUT, bytemuck::bytes_of(&state));
        assert_eq!(json["text"], "l\u{e4}uft");
        assert_eq!(json["processes"][0]["pid"], 7);
        assert!(json.get("reserved").is_none());
        let text = json.to_string();
        assert_eq!(read::<State>(&serde_json::from_str(&text).unwrap()), Ok(state));
    }

    #[test]
    fn every_topic_shows_every_field() {
        for topic in TABLE {
            let layout = layout_of(topic).unwrap();
            let json = to_json(layout, &vec![0; layout.size]);
            let fields = layout.fields.iter().filter(|field| !field.is_reserved()).count();
            assert_eq!(json.as_object().unwrap().len(), fields, "{}", topic.name);
        }
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let cases = [
            (json!([]), "", "an array of 0", "an object of Fix"),
            (json!({"z": 1}), "z", "no field of that name", "header, x, y, yaw"),
            (json!({"x": "1"}), "x", "\"1\"", "a finite number"),
            (json!({"x": null}), "x", "null", "a finite number"),
            (json!({"covariance": [1]}), "covariance", "an array of 1", "an array of 9"),
            (json!({"header": {"topic": 65_536}}), "header.topic", "65536", "0 to 65535"),
            (json!({"header": {"stamp": -1}}), "header.stamp", "-1", "an integer, 0 to"),
            (json!({"source": "a\u{0}b"}), "source", "u{0}", "at most 32 bytes"),
            (json!({"reserved": []}), "reserved", "no field", "header"),
        ];
        for (value, path, found, allowed) in cases {
            let error = read::<Fix>(&value).unwrap_err();
            assert_eq!(error.path, path, "{value}");
            assert!(error.found.contains(found), "{error}");
            assert!(error.allowed.contains(allowed), "{error}");
        }
    }

    #[test]
    fn what_must_be_there_and_what_must_not() {
        let presence = |path: &str| match path {
            "x" => Presence::Required,
            "source" => Presence::FilledIn,
            _ => Presence::Optional,
        };
        let read = |value: &Value| {
            let mut fix = Fix::default();
            from_json(Fix::LAYOUT, value, &presence, bytemuck::bytes_of_mut(&mut fix)).map(|()| fix)
        };
        assert_eq!(read(&json!({})).unwrap_err().found, "nothing");
        assert_eq!(read(&json!({"x": 1, "source": "me"})).unwrap_err().path, "source");
        assert_eq!(read(&json!({"x": 1})).unwrap().x, 1.0);
    }
}
