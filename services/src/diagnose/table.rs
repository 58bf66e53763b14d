//! The table of a batch as one Parquet file: a row a case.

use std::path::Path;
use std::sync::Arc;

use parquet::basic::{ConvertedType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::Type;
use serde_json::Value;

use super::files;
use crate::exit::Failure;

/// A case, and its diagnosis.json or why there is none.
#[derive(Clone, Debug)]
pub struct Row {
    /// Name of the case.
    pub case: String,
    /// What came of it.
    pub result: Result<Value, String>,
}

/// A column: its name, and a value per row, which may be missing.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    name: String,
    cells: Cells,
}

#[derive(Clone, Debug, PartialEq)]
enum Cells {
    Text(Vec<Option<String>>),
    Number(Vec<Option<f64>>),
}

/// Figures of each link.
const LINK_FIGURES: [&str; 6] = ["gap", "floor", "allowance", "excess", "low", "high"];

/// Links in the order of cause.
const LINKS: [&str; 5] =
    ["speed_actuation", "steering_actuation", "sensing", "ground", "reference"];

/// Writes the table.
///
/// # Errors
/// [`Failure`] where the file cannot be written.
pub fn write(path: &Path, rows: &[&Row]) -> Result<(), Failure> {
    let bytes = encoded(&columns(rows)).map_err(Failure::internal)?;
    files::whole(path, &bytes)
}

/// The table's columns.
pub fn columns(rows: &[&Row]) -> Vec<Column> {
    let document = |row: &Row| row.result.as_ref().ok().cloned().unwrap_or_default();
    let text = |name: &str, of: &dyn Fn(&Value) -> Option<String>| {
        let cells = rows.iter().map(|row| of(&document(row))).collect();
        Column { name: name.to_owned(), cells: Cells::Text(cells) }
    };
    let number = |name: &str, of: &dyn Fn(&Value) -> Option<f64>| {
        let cells = rows.iter().map(|row| of(&document(row))).collect();
        Column { name: name.to_owned(), cells: Cells::Number(cells) }
    };
    let cases = rows.iter().map(|row| Some(row.case.clone())).collect();
    let errors = rows.iter().map(|row| row.result.as_ref().err().cloned()).collect();
    let string = |key: &'static str| move |of: &Value| of[key].as_str().map(str::to_owned);
    let pointer = |path: &'static str| move |of: &Value| of.pointer(path)?.as_f64();
    let mut columns = vec![
        Column { name: "case".to_owned(), cells: Cells::Text(cases) },
        Column { name: "error".to_owned(), cells: Cells::Text(errors) },
        text("verdict", &string("verdict")),
        text("where", &|of| joined(&of["where"])),
        text("effects", &|of| of.is_object().then(|| effects(of))),
        number("probability", &probability),
        text("parameters", &|of| of.get("effects").map(Value::to_string)),
        text("alternatives", &|of| of.get("alternatives").map(Value::to_string)),
        text("regime", &string("regime")),
        text("sentence", &string("sentence")),
        number("before_m", &pointer("/gap/before")),
        number("after_m", &pointer("/gap/after")),
        number("floor_m", &pointer("/gap/floor")),
        number("removed", &pointer("/gap/explainable_removed")),
        number("removed_low", &pointer("/gap/low")),
        number("removed_high", &pointer("/gap/high")),
    ];
    for (index, link) in LINKS.into_iter().enumerate() {
        for figure in LINK_FIGURES {
            let of = |of: &Value| link_of(of, index)?.get(figure)?.as_f64();
            columns.push(number(&format!("{link}_{figure}"), &of));
        }
        let unit = |of: &Value| Some(link_of(of, index)?.get("unit")?.as_str()?.to_owned());
        columns.push(text(&format!("{link}_unit"), &unit));
    }
    columns.extend([
        text("not_excited", &|of| joined(&of["not_excited"])),
        text("next", &|of| of.pointer("/next/manoeuvre")?.as_str().map(str::to_owned)),
        number("duration_s", &pointer("/duration_s")),
        number("seconds", &pointer("/seconds")),
        text("version", &string("version")),
    ]);
    columns
}

fn link_of(document: &Value, index: usize) -> Option<&Value> {
    document["links"].as_array()?.iter().find(|link| link["name"] == LINKS[index])
}

/// A text, or texts with a plus between them; none where there is none.
fn joined(value: &Value) -> Option<String> {
    let texts = match value {
        Value::String(text) => vec![text.as_str()],
        Value::Array(texts) => texts.iter().filter_map(Value::as_str).collect(),
        _ => return None,
    };
    Some(texts.join(" + "))
}

/// The effects of a document, with a plus between them.
pub fn effects(document: &Value) -> String {
    let effects = document["effects"].as_array();
    let ids = effects.into_iter().flatten().filter_map(|effect| effect["id"].as_str());
    ids.collect::<Vec<_>>().join(" + ")
}

/// Of the answer: of the alternative that is the answer's effects, else of the word in the ranking.
fn probability(document: &Value) -> Option<f64> {
    let effects = document["effects"].as_array()?;
    let ids: Vec<&Value> = effects.iter().map(|effect| &effect["id"]).collect();
    let is_answer = |set: &&Value| {
        let set = set["ids"].as_array().map_or(&[][..], Vec::as_slice);
        set.len() == ids.len() && set.iter().all(|id| ids.contains(&id))
    };
    if !ids.is_empty() {
        return document["alternatives"].as_array()?.iter().find(is_answer)?["probability"]
            .as_f64();
    }
    let ranking = document["ranking"].as_array()?;
    ranking.iter().find(|rival| rival[0] == document["verdict"])?[1].as_f64()
}

/// The file's bytes.
fn encoded(columns: &[Column]) -> Result<Vec<u8>, ParquetError> {
    let fields = columns.iter().map(field).collect::<Result<_, _>>()?;
    let schema = Type::group_type_builder("diagnoses").with_fields(fields).build()?;
    let properties = WriterProperties::builder()
        .set_created_by(format!("kerbside {}", env!("CARGO_PKG_VERSION")))
        .set_dictionary_enabled(false)
        .build();
    let mut bytes = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut bytes, Arc::new(schema), Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for column in columns {
        match &column.cells {
            Cells::Text(cells) => {
                let text = |text: &String| ByteArray::from(text.as_str());
                append::<ByteArrayType>(
                    &mut group,
                    cells.iter().map(|cell| cell.as_ref().map(text)),
                )?;
            }
            Cells::Number(cells) => append::<DoubleType>(&mut group, cells.iter().copied())?,
        }
    }
    group.close()?;
    writer.close()?;
    Ok(bytes)
}

fn field(column: &Column) -> Result<Arc<Type>, ParquetError> {
    let (physical, converted) = match column.cells {
        Cells::Text(_) => (Physical::BYTE_ARRAY, ConvertedType::UTF8),
        Cells::Number(_) => (Physical::DOUBLE, ConvertedType::NONE),
    };
    let field = Type::primitive_type_builder(&column.name, physical)
        .with_repetition(Repetition::OPTIONAL)
        .with_converted_type(converted)
        .build()?;
    Ok(Arc::new(field))
}

/// Appends the next column: what is there, and for each row whether it is there.
fn append<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, &mut Vec<u8>>,
    cells: impl Iterator<Item = Option<T::T>>,
) -> Result<(), ParquetError> {
    let mut there = Vec::new();
    let mut values = Vec::new();
    for cell in cells {
        there.push(i16::from(cell.is_some()));
        values.extend(cell);
    }
    let missing =
        || ParquetError::General("the table has fewer columns than its schema".to_owned());
    let mut column = group.next_column()?.ok_or_else(missing)?;
    column.typed::<T>().write_batch(&values, Some(&there), None)?;
    column.close()
}
