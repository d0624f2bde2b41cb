//! Strokes as a table for other programs: CSV and Parquet from the same columns.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::sync::Arc;

use jiff::Timestamp;
use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};

use crate::archive::text;
use crate::{Error, Stroke};

/// Strokes as a table: one row each, with a column for every figure that any of them has and for everything that the
/// press said of them (`press.` and its name). What a stroke does not have is empty, never 0.
#[derive(Debug, Clone, PartialEq)]
pub struct StrokeTable {
    columns: Vec<(String, Column)>,
    n_rows: usize,
}

/// One column, a cell a row.
#[derive(Debug, Clone, PartialEq)]
enum Column {
    Count(Vec<Option<u32>>),
    Switch(Vec<Option<bool>>),
    Text(Vec<Option<String>>),
    Time(Vec<Option<Timestamp>>),
    Number(Vec<Option<f64>>),
}

impl StrokeTable {
    /// The table of these strokes, in their order.
    pub fn new(strokes: &[Stroke]) -> Self {
        let count = |take: fn(&Stroke) -> Option<u32>| Column::Count(strokes.iter().map(take).collect());
        let switch =
            |take: fn(&Stroke) -> bool| Column::Switch(strokes.iter().map(|s| Some(take(s))).collect());
        let words = |take: fn(&Stroke) -> Option<String>| Column::Text(strokes.iter().map(take).collect());
        let time = |take: fn(&Stroke) -> Option<Timestamp>| Column::Time(strokes.iter().map(take).collect());
        let fixed = [
            ("run_id", count(|s| Some(s.run_id))),
            ("press", count(|s| Some(s.key.press.into()))),
            ("session", count(|s| Some(s.key.session.into()))),
            ("stroke", count(|s| Some(s.key.stroke.into()))),
            ("attempt", count(|s| Some(s.key.attempt.into()))),
            ("plate", count(|s| Some(s.plate))),
            ("recipe", count(|s| s.recipe.map(u32::from))),
            ("baseline", switch(|s| s.baseline)),
            ("dry_run", switch(|s| s.dry_run)),
            ("accepted", time(|s| Some(s.accepted))),
            ("scanned", time(|s| s.scanned)),
            ("finished", time(|s| s.finished)),
            ("acked", time(|s| s.acked)),
            ("verdict", words(|s| s.verdict.map(|verdict| verdict.as_str().to_owned()))),
            ("reason", words(|s| s.reason.clone())),
        ];
        let mut columns: Vec<(String, Column)> =
            fixed.into_iter().map(|(name, column)| (name.to_owned(), column)).collect();
        columns.extend(told(strokes));
        let names: BTreeSet<&String> = strokes.iter().flat_map(|stroke| stroke.figures.keys()).collect();
        columns.extend(names.into_iter().map(|name| {
            let figure = |stroke: &Stroke| stroke.figures.get(name).copied();
            (name.clone(), Column::Number(strokes.iter().map(figure).collect()))
        }));
        Self { columns, n_rows: strokes.len() }
    }

    /// Writes CSV (RFC 4180).
    ///
    /// # Errors
    /// [`Error::Export`].
    pub fn write_csv(&self, out: &mut impl Write) -> Result<(), Error> {
        line(out, self.columns.iter().map(|(name, _)| name.clone()))?;
        for row in 0..self.n_rows {
            line(out, self.columns.iter().map(|(_, column)| column.cell(row)))?;
        }
        Ok(())
    }

    /// Writes Parquet, uncompressed: one row group; times are UTC in milliseconds, numbers doubles, every cell may be null.
    ///
    /// # Errors
    /// [`Error::Parquet`].
    pub fn write_parquet(&self, out: &mut (impl Write + Send)) -> Result<(), Error> {
        let fields =
            self.columns.iter().map(|(name, column)| column.field(name)).collect::<Result<_, _>>()?;
        let schema = Arc::new(Type::group_type_builder("strokes").with_fields(fields).build()?);
        let properties = Arc::new(WriterProperties::builder().build());
        let mut writer = SerializedFileWriter::new(out, schema, properties)?;
        let mut rows = writer.next_row_group()?;
        for (_, column) in &self.columns {
            column.write(&mut rows)?;
        }
        rows.close()?;
        writer.close()?;
        Ok(())
    }
}

/// What the press said, as far as it is single numbers, words and switches.
fn told(strokes: &[Stroke]) -> Vec<(String, Column)> {
    use serde_json::Value;
    let all: Vec<BTreeMap<String, Value>> =
        strokes.iter().map(|stroke| serde_json::from_str(&stroke.data).unwrap_or_default()).collect();
    let names: BTreeSet<&String> = all.iter().flat_map(BTreeMap::keys).collect();
    let column = |name: &String| {
        let cells = || all.iter().map(|told| told.get(name).filter(|value| !value.is_null()));
        let every = |is: fn(&Value) -> bool| cells().flatten().all(is) && cells().flatten().next().is_some();
        let column = if every(Value::is_number) {
            Column::Number(cells().map(|value| value.and_then(Value::as_f64)).collect())
        } else if every(Value::is_boolean) {
            Column::Switch(cells().map(|value| value.and_then(Value::as_bool)).collect())
        } else if every(Value::is_string) {
            Column::Text(cells().map(|value| value.and_then(Value::as_str).map(str::to_owned)).collect())
        } else {
            return None;
        };
        Some((format!("press.{name}"), column))
    };
    // These have a column of their own.
    names
        .into_iter()
        .filter(|name| !["baseline", "dry_run"].contains(&name.as_str()))
        .filter_map(column)
        .collect()
}

impl Column {
    fn cell(&self, row: usize) -> String {
        fn shown<T: ToString>(value: Option<&T>) -> String {
            value.map(T::to_string).unwrap_or_default()
        }
        match self {
            Self::Count(cells) => shown(cells[row].as_ref()),
            Self::Switch(cells) => shown(cells[row].as_ref()),
            Self::Text(cells) => shown(cells[row].as_ref()),
            Self::Time(cells) => cells[row].map(text).unwrap_or_default(),
            Self::Number(cells) => shown(cells[row].as_ref()),
        }
    }

    fn field(&self, name: &str) -> parquet::errors::Result<TypePtr> {
        let (physical, logical) = match self {
            Self::Count(_) => (Physical::INT32, Some(LogicalType::integer(32, false))),
            Self::Switch(_) => (Physical::BOOLEAN, None),
            Self::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Self::Time(_) => (Physical::INT64, Some(LogicalType::timestamp(true, TimeUnit::MILLIS))),
            Self::Number(_) => (Physical::DOUBLE, None),
        };
        let field = Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical);
        Ok(Arc::new(field.build()?))
    }

    fn write<W: Write + Send>(
        &self,
        rows: &mut SerializedRowGroupWriter<'_, W>,
    ) -> parquet::errors::Result<()> {
        match self {
            // A count above half the range keeps its bits: the column says that it is unsigned.
            Self::Count(cells) => put::<Int32Type, _, _>(rows, cells, |count| *count as i32),
            Self::Switch(cells) => put::<BoolType, _, _>(rows, cells, |on| *on),
            Self::Text(cells) => {
                put::<ByteArrayType, _, _>(rows, cells, |text| ByteArray::from(text.as_str()))
            }
            Self::Time(cells) => put::<Int64Type, _, _>(rows, cells, |time| time.as_millisecond()),
            Self::Number(cells) => put::<DoubleType, _, _>(rows, cells, |number| *number),
        }
    }
}

/// Writes the next column; a cell that is empty has definition level 0.
fn put<D: DataType, W: Write + Send, T>(
    rows: &mut SerializedRowGroupWriter<'_, W>,
    cells: &[Option<T>],
    value: impl Fn(&T) -> D::T,
) -> parquet::errors::Result<()> {
    let levels: Vec<i16> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
    let values: Vec<D::T> = cells.iter().flatten().map(value).collect();
    let mut column = rows.next_column()?.ok_or_else(|| {
        parquet::errors::ParquetError::General("the schema has fewer columns than the table".to_owned())
    })?;
    column.typed::<D>().write_batch(&values, Some(&levels), None)?;
    column.close()
}

fn line(out: &mut impl Write, cells: impl Iterator<Item = String>) -> Result<(), Error> {
    let quoted = |cell: String| match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell,
    };
    write!(out, "{}\r\n", cells.map(quoted).collect::<Vec<_>>().join(","))?;
    Ok(())
}
