//! Table of records, which can be written as CSV and as Parquet with the same columns.

use std::io::{self, Write};
use std::sync::Arc;

use jiff::Timestamp;
use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int32Type, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};

use crate::Error;
use crate::archive::text;

/// Table with named columns and one row for each record. A missing value is an empty cell, never 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
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

/// Columns of a table of these records, in their order.
#[derive(Debug)]
pub struct Columns<'a, R> {
    records: &'a [R],
    columns: Vec<(String, Column)>,
}

impl<'a, R> Columns<'a, R> {
    /// Begins a table with one row for each record.
    pub fn of(records: &'a [R]) -> Self {
        Self { records, columns: Vec::new() }
    }

    /// Adds whole numbers from 0.
    #[must_use]
    pub fn unsigned(self, name: &str, cell: impl Fn(&R) -> Option<u32>) -> Self {
        self.with(name, cell, Column::Unsigned)
    }

    /// Adds booleans.
    #[must_use]
    pub fn boolean(self, name: &str, cell: impl Fn(&R) -> Option<bool>) -> Self {
        self.with(name, cell, Column::Boolean)
    }

    /// Adds texts.
    #[must_use]
    pub fn text(self, name: &str, cell: impl Fn(&R) -> Option<String>) -> Self {
        self.with(name, cell, Column::Text)
    }

    /// Adds times.
    #[must_use]
    pub fn time(self, name: &str, cell: impl Fn(&R) -> Option<Timestamp>) -> Self {
        self.with(name, cell, Column::Time)
    }

    /// Adds numbers.
    #[must_use]
    pub fn float(self, name: &str, cell: impl Fn(&R) -> Option<f64>) -> Self {
        self.with(name, cell, Column::Float)
    }

    /// Returns the table.
    pub fn table(self) -> Table {
        Table { columns: self.columns, n_rows: self.records.len() }
    }

    fn with<T>(
        mut self,
        name: &str,
        cell: impl Fn(&R) -> Option<T>,
        column: fn(Vec<Option<T>>) -> Column,
    ) -> Self {
        self.columns.push((name.to_owned(), column(self.records.iter().map(cell).collect())));
        self
    }
}

impl Table {
    /// Returns a table of these rows, with the same columns.
    #[must_use]
    pub fn of_rows(&self, rows: &[usize]) -> Self {
        let columns = self.columns.iter().map(|(name, column)| (name.clone(), column.of_rows(rows)));
        Self { columns: columns.collect(), n_rows: rows.len() }
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

    /// Writes Parquet, uncompressed: one row group; times are UTC in milliseconds, numbers doubles, every cell may be
    /// null.
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

impl Column {
    fn of_rows(&self, rows: &[usize]) -> Self {
        fn take<T: Clone>(cells: &[Option<T>], rows: &[usize]) -> Vec<Option<T>> {
            rows.iter().map(|row| cells[*row].clone()).collect()
        }
        match self {
            Self::Unsigned(cells) => Self::Unsigned(take(cells, rows)),
            Self::Boolean(cells) => Self::Boolean(take(cells, rows)),
            Self::Text(cells) => Self::Text(take(cells, rows)),
            Self::Time(cells) => Self::Time(take(cells, rows)),
            Self::Float(cells) => Self::Float(take(cells, rows)),
        }
    }

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
            // A value above half the range keeps its bit pattern: the column is declared as unsigned.
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
