//! Samples for people and for scripts, made from the layouts alone.

use core::fmt::{self, Write};

use kerbside_messages::layout::{Field, Kind, Layout, Meaning};
use kerbside_messages::schema::tail_of;
use kerbside_messages::topics::layout_of;
use kerbside_messages::{Topic, text};
use serde::ser::{Serialize, SerializeMap, Serializer};

/// Columns that a line of a list keeps to.
const WIDTH: usize = 80;
/// Elements of a list that are shown where not all are asked for.
const SHORT: usize = 16;
/// Name of what follows a plan's head.
const TAIL: &str = "trajectory";

/// What a field holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Shown {
    /// A whole number.
    Whole(i128),
    /// A number; one that is none or infinite becomes null in JSON.
    Number(f64),
    /// The words that a number stands for.
    Words(&'static str, u8),
    /// A text.
    Text(String),
    /// Several of a kind.
    List(Vec<Shown>),
    /// Fields by name, in their order.
    Record(Vec<(&'static str, Shown)>),
}

/// A topic's payload, and what follows it; what is reserved is left out.
#[must_use]
pub fn sample(topic: &Topic, bytes: &[u8], tail: &[u8]) -> Shown {
    let mut fields = layout_of(topic).map(|layout| record(layout, bytes)).unwrap_or_default();
    if let Some(element) = tail_of(topic) {
        let each = tail.chunks_exact(element.size);
        let list = each.map(|bytes| Shown::Record(record(element, bytes))).collect();
        fields.push((TAIL, Shown::List(list)));
    }
    Shown::Record(fields)
}

fn record(layout: &Layout, bytes: &[u8]) -> Vec<(&'static str, Shown)> {
    let shown = layout.fields.iter().filter(|field| !field.is_reserved());
    shown.map(|field| (field.name, field_of(field, bytes))).collect()
}

fn field_of(field: &Field, bytes: &[u8]) -> Shown {
    let size = field.kind.size();
    let bytes = bytes.get(field.offset..).unwrap_or_default();
    let Some(count) = field.count else { return element(field, bytes) };
    let bytes = &bytes[..bytes.len().min(size * count)];
    if field.is_text() {
        return Shown::Text(text::as_str(bytes).to_owned());
    }
    Shown::List(bytes.chunks_exact(size).map(|bytes| element(field, bytes)).collect())
}

fn element(field: &Field, bytes: &[u8]) -> Shown {
    match field.kind {
        Kind::U8 => {
            let [code] = first(bytes);
            match field.meaning {
                Meaning::Code(known) => known
                    .words(code)
                    .map_or(Shown::Whole(code.into()), |words| Shown::Words(words, code)),
                _ => Shown::Whole(code.into()),
            }
        }
        Kind::I8 => Shown::Whole(i8::from_le_bytes(first(bytes)).into()),
        Kind::U16 => Shown::Whole(u16::from_le_bytes(first(bytes)).into()),
        Kind::U32 => Shown::Whole(u32::from_le_bytes(first(bytes)).into()),
        Kind::U64 => Shown::Whole(u64::from_le_bytes(first(bytes)).into()),
        Kind::I64 => Shown::Whole(i64::from_le_bytes(first(bytes)).into()),
        Kind::F64 => Shown::Number(f64::from_le_bytes(first(bytes))),
        Kind::Nested(part) => Shown::Record(record(part, bytes)),
    }
}

fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.first_chunk().copied().unwrap_or([0; N])
}

impl Serialize for Shown {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Whole(number) => serializer.serialize_i128(*number),
            Self::Number(number) => serializer.serialize_f64(*number),
            Self::Words(words, _) => serializer.serialize_str(words),
            Self::Text(text) => serializer.serialize_str(text),
            Self::List(list) => serializer.collect_seq(list),
            Self::Record(fields) => {
                let mut map = serializer.serialize_map(Some(fields.len()))?;
                for (name, value) in fields {
                    map.serialize_entry(name, value)?;
                }
                map.end()
            }
        }
    }
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole(number) => write!(f, "{number}"),
            Self::Number(number) => write!(f, "{number:?}"),
            Self::Words(words, code) => write!(f, "{words} ({code})"),
            Self::Text(text) => write!(f, "{text:?}"),
            Self::List(list) => {
                let all: Vec<_> = list.iter().map(ToString::to_string).collect();
                write!(f, "[{}]", all.join(", "))
            }
            Self::Record(fields) => {
                let all: Vec<_> =
                    fields.iter().map(|(name, value)| format!("{name}: {value}")).collect();
                write!(f, "{{{}}}", all.join(", "))
            }
        }
    }
}

impl Shown {
    /// Lines as people read them; of long lists the beginning, unless all is asked for.
    #[must_use]
    pub fn lines(&self, all: bool) -> String {
        let mut out = String::new();
        if let Self::Record(fields) = self {
            write_fields(&mut out, fields, 0, all);
        }
        out
    }
}

fn write_fields(out: &mut String, fields: &[(&'static str, Shown)], depth: usize, all: bool) {
    for (name, value) in fields {
        let _ = write!(out, "{:depth$}{name}:", "");
        match value {
            Shown::Record(fields) => {
                out.push('\n');
                write_fields(out, fields, depth + 2, all);
            }
            Shown::List(list) => write_list(out, list, depth, name.len() + 1, all),
            single => {
                let _ = writeln!(out, " {single}");
            }
        }
    }
}

fn write_list(out: &mut String, list: &[Shown], depth: usize, used: usize, all: bool) {
    let shown = if all { list } else { &list[..list.len().min(SHORT)] };
    if shown.iter().any(|one| matches!(one, Shown::Record(_))) {
        out.push('\n');
        for one in shown {
            let mut lines = String::new();
            if let Shown::Record(fields) = one {
                write_fields(&mut lines, fields, depth + 2, all);
            }
            let _ = write!(out, "{:depth$}-{}", "", &lines[depth + 1..]);
        }
        if shown.len() < list.len() {
            let _ = writeln!(out, "{:depth$}# {} in all", "", list.len());
        }
        return;
    }
    let (mut column, indent) = (depth + used, depth + 2);
    for (index, one) in shown.iter().enumerate() {
        let before = if index == 0 { " [" } else { " " };
        let after = if index + 1 < shown.len() { "," } else { "" };
        let word = format!("{before}{one}{after}");
        if column + word.len() > WIDTH - 1 {
            let _ = write!(out, "\n{:indent$}", "");
            column = indent;
        }
        out.push_str(&word);
        column += word.len();
    }
    match list.len() {
        0 => out.push_str(" []\n"),
        count if shown.len() < count => {
            let _ = writeln!(out, "] # {count} in all");
        }
        _ => out.push_str("]\n"),
    }
}

/// The way to a field: `header.stamp`, `covariance.0`, `processes.2.pid`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Path {
    /// As it was given.
    pub name: String,
    steps: Vec<Step>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    Field(&'static str),
    Element(usize),
}

/// What may follow on a way.
#[derive(Clone, Copy)]
enum Place {
    Record(&'static Layout, bool),
    List(Kind, usize),
    End,
}

impl Path {
    /// The way to a field of the topic's payload.
    ///
    /// # Errors
    /// A sentence that names what is wrong and what is there.
    pub fn parse(topic: &Topic, name: &str) -> Result<Self, String> {
        let layout = layout_of(topic).ok_or_else(|| format!("{} has no fields", topic.name))?;
        let mut place = Place::Record(layout, tail_of(topic).is_some());
        let (mut steps, mut passed) = (Vec::new(), topic.name.to_owned());
        for word in name.split('.') {
            let (step, next) = follow(topic, place, word)
                .map_err(|allowed| format!("{name}: {passed} has no {word:?}; it has {allowed}"))?;
            steps.push(step);
            let _ = write!(passed, ".{word}");
            place = next;
        }
        Ok(Self { name: name.to_owned(), steps })
    }

    /// What is there; none beyond the end of a plan's points.
    #[must_use]
    pub fn find<'a>(&self, shown: &'a Shown) -> Option<&'a Shown> {
        self.steps.iter().try_fold(shown, |shown, step| match (shown, step) {
            (Shown::Record(fields), Step::Field(name)) => {
                fields.iter().find(|(known, _)| known == name).map(|(_, value)| value)
            }
            (Shown::List(list), Step::Element(index)) => list.get(*index),
            _ => None,
        })
    }
}

/// One step; the error says what is allowed.
fn follow(topic: &Topic, place: Place, word: &str) -> Result<(Step, Place), String> {
    match place {
        Place::Record(layout, has_tail) => {
            if let Some(element) = tail_of(topic).filter(|_| has_tail && word == TAIL) {
                let list = Place::List(Kind::Nested(element), kerbside_messages::MAX_PLAN_POINTS);
                return Ok((Step::Field(TAIL), list));
            }
            let shown = || layout.fields.iter().filter(|field| !field.is_reserved());
            let Some(field) = shown().find(|field| field.name == word) else {
                let names = shown().map(|field| field.name).chain(has_tail.then_some(TAIL));
                return Err(names.collect::<Vec<_>>().join(", "));
            };
            let next = match field.count {
                Some(count) if field.meaning != Meaning::Text => Place::List(field.kind, count),
                _ => beyond(field.kind),
            };
            Ok((Step::Field(field.name), next))
        }
        Place::List(kind, count) => match word.parse() {
            Ok(index) if index < count => Ok((Step::Element(index), beyond(kind))),
            _ => Err(format!("0 to {}", count - 1)),
        },
        Place::End => Err("no parts".to_owned()),
    }
}

fn beyond(kind: Kind) -> Place {
    match kind {
        Kind::Nested(part) => Place::Record(part, false),
        _ => Place::End,
    }
}

#[cfg(test)]
mod tests {
    use kerbside_messages::topics::{ODOMETRY, PLAN, STATE};
    use kerbside_messages::{
        EstimatorState, Mode, Odometry, Plan, Process, State, TrajectoryPoint,
    };

    use super::*;

    fn shown(topic: &Topic, path: &str, sample: &Shown) -> String {
        Path::parse(topic, path).unwrap().find(sample).unwrap().to_string()
    }

    #[test]
    fn fields_are_found_by_their_way() {
        let mut state = State { mode: Mode::Armed.code(), culprit: 255, ..State::default() };
        state.text = text::from_str("no plan yet");
        state.processes[2].pid = 77;
        state.processes[2].process = Process::Estimator as u8;
        let sample = sample(&STATE, bytemuck::bytes_of(&state), &[]);
        let found = |path| shown(&STATE, path, &sample);
        assert_eq!(
            (found("processes.2.pid"), found("processes.2.process")),
            ("77".into(), "estimator (2)".into())
        );
        assert_eq!(found("text"), "\"no plan yet\"");
        assert_eq!((found("mode").as_str(), found("culprit").as_str()), ("armed (2)", "255"));
    }

    #[test]
    fn a_way_that_leads_nowhere_is_told_what_is_there() {
        let said = |path| Path::parse(&ODOMETRY, path).unwrap_err();
        assert!(said("z").contains("odometry has no \"z\"; it has header, x, y"), "{}", said("z"));
        assert!(said("covariance.9").contains("it has 0 to 8"));
        assert!(said("x.y").contains("odometry.x has no \"y\"; it has no parts"));
        assert!(said("header.stamps").contains("version, topic"));
        assert!(!said("z").contains("reserved"));
        assert!(Path::parse(&PLAN, "trajectory.4095.x").is_ok());
    }

    #[test]
    fn json_and_lines_hold_what_was_sent_in_its_order() {
        let mut odometry =
            Odometry { x: 1.25, state: EstimatorState::Valid.code(), ..Odometry::default() };
        odometry.covariance[0] = f64::INFINITY;
        let sample = sample(&ODOMETRY, bytemuck::bytes_of(&odometry), &[]);
        let json = serde_json::to_string(&sample).unwrap();
        assert!(json.starts_with("{\"header\":{\"version\":0,"), "{json}");
        assert!(json.contains("\"x\":1.25,\"y\":0.0,") && json.contains("\"state\":\"valid\""));
        assert!(json.contains("\"covariance\":[null,0.0"), "{json}");
        let lines = sample.lines(false);
        assert!(lines.contains("header:\n  version: 0\n") && lines.contains("\nx: 1.25\ny: 0.0\n"));
        assert!(lines.contains("# 45 in all") && !sample.lines(true).contains("in all"), "{lines}");
        for line in lines.lines().chain(sample.lines(true).lines()) {
            assert!(line.chars().count() <= WIDTH, "{line}");
        }
    }

    #[test]
    fn a_plan_has_its_points() {
        let points = [TrajectoryPoint { x: 2.0, ..TrajectoryPoint::default() }; 20];
        let plan = Plan { points: 20, ..Plan::default() };
        let sample = sample(&PLAN, bytemuck::bytes_of(&plan), bytemuck::cast_slice(&points));
        assert_eq!(shown(&PLAN, "trajectory.19.x", &sample), "2.0");
        assert!(Path::parse(&PLAN, "trajectory.20.x").unwrap().find(&sample).is_none());
        let lines = sample.lines(false);
        assert!(
            lines.contains("trajectory:\n- time: 0.0\n  x: 2.0\n") && lines.contains("# 20 in all")
        );
    }
}
