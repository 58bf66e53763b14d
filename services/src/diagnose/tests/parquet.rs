//! Readers of Parquet that share nothing with the writer: a small one for files of one row group, one plain page per
//! column and no compression (Apache Parquet, "File format", with Thrift's compact protocol), and, where Python has
//! it, pyarrow.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use serde_json::{Map, Value, json};

/// A row by the names of its columns.
pub(super) type Row = Map<String, Value>;

/// The rows of a file, by the small reader; pyarrow must say the same where it is there.
pub(super) fn read(path: &Path) -> Vec<Row> {
    let bytes = std::fs::read(path).unwrap();
    let rows = rows(&bytes);
    match by_pyarrow(path) {
        Some(others) => assert_eq!(rows, others),
        None => eprintln!(
            "skipped: python3 has no pyarrow, the small reader alone has read {}",
            path.display()
        ),
    }
    rows
}

fn by_pyarrow(path: &Path) -> Option<Vec<Row>> {
    const SCRIPT: &str = "import json, sys, pyarrow.parquet as p; \
                          print(json.dumps(p.read_table(sys.argv[1]).to_pylist()))";
    let asked = Command::new("python3").args(["-c", "import pyarrow.parquet"]).output().ok()?;
    if !asked.status.success() {
        return None;
    }
    let said = Command::new("python3").args(["-c", SCRIPT]).arg(path).output().unwrap();
    assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    Some(serde_json::from_slice(&said.stdout).unwrap())
}

/// A value of Thrift's compact protocol.
#[derive(Debug)]
enum Thrift {
    Int(i64),
    Bytes(Vec<u8>),
    List(Vec<Thrift>),
    Struct(BTreeMap<i64, Thrift>),
    Other,
}

impl Thrift {
    fn field(&self, id: i64) -> &Thrift {
        let Self::Struct(fields) = self else { panic!("no struct: {self:?}") };
        fields.get(&id).unwrap_or_else(|| panic!("no field {id}: {self:?}"))
    }

    fn int(&self) -> i64 {
        let Self::Int(value) = self else { panic!("no number: {self:?}") };
        *value
    }

    fn text(&self) -> String {
        let Self::Bytes(bytes) = self else { panic!("no text: {self:?}") };
        String::from_utf8(bytes.clone()).unwrap()
    }

    fn list(&self) -> &[Thrift] {
        let Self::List(list) = self else { panic!("no list: {self:?}") };
        list
    }
}

/// Bytes, and how far they are read.
struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> &'a [u8] {
        let (taken, rest) = self.0.split_at(count);
        self.0 = rest;
        taken
    }

    fn byte(&mut self) -> u8 {
        self.take(1)[0]
    }

    fn size(&mut self) -> usize {
        u32::from_le_bytes(self.take(4).try_into().unwrap()) as usize
    }

    fn varint(&mut self) -> u64 {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte();
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                break;
            }
        }
        value
    }

    fn zigzag(&mut self) -> i64 {
        let value = self.varint();
        (value >> 1) as i64 ^ -((value & 1) as i64)
    }

    fn thrift(&mut self, kind: u8) -> Thrift {
        match kind {
            1 | 2 => Thrift::Other,
            3 => Thrift::Int(i64::from(self.byte() as i8)),
            4..=6 => Thrift::Int(self.zigzag()),
            7 => {
                self.take(8);
                Thrift::Other
            }
            8 => {
                let length = self.varint() as usize;
                Thrift::Bytes(self.take(length).to_vec())
            }
            9 | 10 => {
                let head = self.byte();
                let count = if head >> 4 == 15 { self.varint() } else { u64::from(head >> 4) };
                // In a list a boolean takes a byte.
                let item = |cursor: &mut Self| match head & 15 {
                    1 | 2 => Thrift::Int(i64::from(cursor.byte())),
                    kind => cursor.thrift(kind),
                };
                Thrift::List((0..count).map(|_| item(self)).collect())
            }
            12 => self.fields(),
            kind => panic!("kind {kind}"),
        }
    }

    fn fields(&mut self) -> Thrift {
        let mut fields = BTreeMap::new();
        let mut id = 0;
        loop {
            let head = self.byte();
            if head == 0 {
                return Thrift::Struct(fields);
            }
            id = if head >> 4 == 0 { self.zigzag() } else { id + i64::from(head >> 4) };
            fields.insert(id, self.thrift(head & 15));
        }
    }

    /// Levels of one bit each, in runs or packed by eights.
    fn levels(&mut self, count: usize) -> Vec<bool> {
        let length = self.size();
        let mut cursor = Cursor(self.take(length));
        let mut levels = Vec::new();
        while levels.len() < count {
            let head = cursor.varint();
            if head & 1 == 0 {
                let level = cursor.byte() != 0;
                levels.extend(std::iter::repeat_n(level, (head >> 1) as usize));
            } else {
                for _ in 0..head >> 1 {
                    let byte = cursor.byte();
                    levels.extend((0..8).map(|bit| byte >> bit & 1 == 1));
                }
            }
        }
        levels.truncate(count);
        levels
    }
}

/// Physical types.
const DOUBLE: i64 = 5;
const BYTE_ARRAY: i64 = 6;

fn rows(bytes: &[u8]) -> Vec<Row> {
    let (head, tail) = (&bytes[..4], &bytes[bytes.len() - 8..]);
    assert_eq!((head, &tail[4..]), (&b"PAR1"[..], &b"PAR1"[..]));
    let footer = Cursor(tail).size();
    let meta = Cursor(&bytes[bytes.len() - 8 - footer..]).fields();
    let count = usize::try_from(meta.field(3).int()).unwrap();
    let [group] = meta.field(4).list() else { panic!("one row group is expected") };
    let mut rows = vec![Row::new(); count];
    for chunk in group.field(1).list() {
        let column = chunk.field(3);
        let [name] = column.field(3).list() else { panic!("a flat table is expected") };
        assert_eq!(column.field(4).int(), 0, "no compression is expected");
        let begin = usize::try_from(column.field(9).int()).unwrap();
        let cells = cells(&bytes[begin..], column.field(1).int(), count);
        for (row, cell) in rows.iter_mut().zip(cells) {
            row.insert(name.text(), cell);
        }
    }
    rows
}

/// The cells of a column's only page.
fn cells(bytes: &[u8], kind: i64, count: usize) -> Vec<Value> {
    let mut cursor = Cursor(bytes);
    let page = cursor.fields();
    let header = page.field(5);
    assert_eq!((page.field(1).int(), header.field(2).int()), (0, 0), "a plain page is expected");
    assert_eq!(header.field(1).int(), count as i64, "one page is expected");
    let levels = cursor.levels(count);
    let mut cell = |is_there: bool| match (is_there, kind) {
        (false, _) => Value::Null,
        (true, DOUBLE) => json!(f64::from_le_bytes(cursor.take(8).try_into().unwrap())),
        (true, BYTE_ARRAY) => {
            let length = cursor.size();
            json!(std::str::from_utf8(cursor.take(length)).unwrap())
        }
        (true, kind) => panic!("type {kind}"),
    };
    levels.into_iter().map(&mut cell).collect()
}
