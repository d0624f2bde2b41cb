//! Export of strokes as a table: CSV and Parquet from the same columns.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};
use std::sync::Arc;

use jiff::Timestamp;
use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};

use crate::archive::text;
use crate::{Error, Stroke};

/// Table of strokes: one row each, with a column for every figure of any stroke and for every value of the press (`press.`
/// and its name). A missing value is an empty cell, never 0.
#[derive(Debug, Clone, PartialEq)]
pub struct StrokeTable {
    columns: Vec<(String, Column)>,
    n_rows: usize,
}

/// Column of a table, one cell per row.
#[derive(Debug, Clone, PartialEq)]
enum Column {
    Unsigned(Vec<Option<u32>>),
    Boolean(Vec<Option<bool>>),
    Text(Vec<Option<String>>),
    Time(Vec<Option<Timestamp>>),
    Float(Vec<Option<f64>>),
}

impl StrokeTable {
    /// Makes the table of `strokes`, in their order.
    pub fn new(strokes: &[Stroke]) -> Self {
        let unsigned =
            |take: fn(&Stroke) -> Option<u32>| Column::Unsigned(strokes.iter().map(take).collect());
        let boolean =
            |take: fn(&Stroke) -> bool| Column::Boolean(strokes.iter().map(|s| Some(take(s))).collect());
        let string = |take: fn(&Stroke) -> Option<String>| Column::Text(strokes.iter().map(take).collect());
        let time = |take: fn(&Stroke) -> Option<Timestamp>| Column::Time(strokes.iter().map(take).collect());
        let fixed = [
            ("run_id", unsigned(|s| Some(s.run_id))),
            ("press", unsigned(|s| Some(s.key.press.into()))),
            ("session", unsigned(|s| Some(s.key.session.into()))),
            ("stroke", unsigned(|s| Some(s.key.stroke.into()))),
            ("attempt", unsigned(|s| Some(s.key.attempt.into()))),
            ("plate", unsigned(|s| Some(s.plate))),
            ("recipe", unsigned(|s| s.recipe.map(u32::from))),
            ("baseline", boolean(|s| s.baseline)),
            ("dry_run", boolean(|s| s.dry_run)),
            ("accepted", time(|s| Some(s.accepted))),
            ("scanned", time(|s| s.scanned)),
            ("finished", time(|s| s.finished)),
            ("acked", time(|s| s.acked)),
            ("verdict", string(|s| s.verdict.map(|verdict| verdict.as_str().to_owned()))),
            ("reason", string(|s| s.reason.clone())),
        ];
        let mut columns: Vec<(String, Column)> =
            fixed.into_iter().map(|(name, column)| (name.to_owned(), column)).collect();
        columns.extend(press_columns(strokes));
        let names: BTreeSet<&String> = strokes.iter().flat_map(|stroke| stroke.figures.keys()).collect();
        columns.extend(names.into_iter().map(|name| {
            let figure = |stroke: &Stroke| stroke.figures.get(name).copied();
            (name.clone(), Column::Float(strokes.iter().map(figure).collect()))
        }));
        Self { columns, n_rows: strokes.len() }
    }

    /// Writes CSV (RFC 4180).
    ///
    /// # Errors
    /// [`Error::Export`].
    pub fn write_csv(&self, out: &mut impl Write) -> Result<(), Error> {
        let mut csv = csv::WriterBuilder::new().terminator(csv::Terminator::CRLF).from_writer(out);
        csv.write_record(self.columns.iter().map(|(name, _)| name)).map_err(io::Error::from)?;
        for row in 0..self.n_rows {
            csv.write_record(self.columns.iter().map(|(_, column)| column.cell(row)))
                .map_err(io::Error::from)?;
        }
        Ok(csv.flush()?)
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

/// Returns the values of the press that are single numbers, texts or booleans in every stroke.
fn press_columns(strokes: &[Stroke]) -> Vec<(String, Column)> {
    use serde_json::Value;
    let all: Vec<BTreeMap<String, Value>> =
        strokes.iter().map(|stroke| serde_json::from_str(&stroke.data).unwrap_or_default()).collect();
    let names: BTreeSet<&String> = all.iter().flat_map(BTreeMap::keys).collect();
    let column = |name: &String| {
        let cells = || all.iter().map(|values| values.get(name).filter(|value| !value.is_null()));
        let every = |is: fn(&Value) -> bool| cells().flatten().all(is) && cells().flatten().next().is_some();
        let column = if every(Value::is_number) {
            Column::Float(cells().map(|value| value.and_then(Value::as_f64)).collect())
        } else if every(Value::is_boolean) {
            Column::Boolean(cells().map(|value| value.and_then(Value::as_bool)).collect())
        } else if every(Value::is_string) {
            Column::Text(cells().map(|value| value.and_then(Value::as_str).map(str::to_owned)).collect())
        } else {
            return None;
        };
        Some((format!("press.{name}"), column))
    };
    // The other two have a column of their own.
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
            Self::Unsigned(cells) => shown(cells[row].as_ref()),
            Self::Boolean(cells) => shown(cells[row].as_ref()),
            Self::Text(cells) => shown(cells[row].as_ref()),
            Self::Time(cells) => cells[row].map(text).unwrap_or_default(),
            Self::Float(cells) => shown(cells[row].as_ref()),
        }
    }

    fn field(&self, name: &str) -> parquet::errors::Result<TypePtr> {
        let (physical, logical) = match self {
            Self::Unsigned(_) => (Physical::INT32, Some(LogicalType::integer(32, false))),
            Self::Boolean(_) => (Physical::BOOLEAN, None),
            Self::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Self::Time(_) => (Physical::INT64, Some(LogicalType::timestamp(true, TimeUnit::MILLIS))),
            Self::Float(_) => (Physical::DOUBLE, None),
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
            // A value above half the range keeps its bits: the column is declared as unsigned.
            Self::Unsigned(cells) => put::<Int32Type, _, _>(rows, cells, |value| *value as i32),
            Self::Boolean(cells) => put::<BoolType, _, _>(rows, cells, |value| *value),
            Self::Text(cells) => {
                put::<ByteArrayType, _, _>(rows, cells, |text| ByteArray::from(text.as_str()))
            }
            Self::Time(cells) => put::<Int64Type, _, _>(rows, cells, |time| time.as_millisecond()),
            Self::Float(cells) => put::<DoubleType, _, _>(rows, cells, |number| *number),
        }
    }
}

/// Writes the next column. An empty cell has definition level 0.
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
