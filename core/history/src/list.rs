//! List of run ids selected by another program: a column `run_id` in a CSV or Parquet file.

use std::fs::File;
use std::path::Path;

use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;

use crate::Error;

/// Column that is read; all others are ignored.
const COLUMN: &str = "run_id";

/// Returns the run ids of a file in its order. The file is Parquet if its name ends so, else CSV with a head.
///
/// # Errors
/// [`Error::Unreachable`]; [`Error::Foreign`] without the column, or with a cell that is not a run id.
pub fn run_ids(path: &Path) -> Result<Vec<u32>, Error> {
    let file = File::open(path).map_err(|source| Error::Unreachable { path: path.to_owned(), source })?;
    let read = if path.extension().is_some_and(|end| end == "parquet") { of_parquet } else { of_csv };
    read(file).map_err(|why| Error::Foreign { path: path.to_owned(), why })
}

fn missing() -> String {
    format!("has no column {COLUMN}; `platen history export` writes one")
}

fn wrong(cell: impl std::fmt::Display, row: usize) -> String {
    format!("row {row}: found {cell} in the column {COLUMN}, expected a run id")
}

fn of_csv(file: File) -> Result<Vec<u32>, String> {
    let mut rows = csv::Reader::from_reader(file);
    let head = rows.headers().map_err(|why| why.to_string())?;
    let column = head.iter().position(|name| name == COLUMN).ok_or_else(missing)?;
    let cell = |(k, row): (usize, csv::Result<csv::StringRecord>)| {
        let row = row.map_err(|why| why.to_string())?;
        let cell = row.get(column).unwrap_or_default();
        cell.trim().parse().map_err(|_| wrong(format!("{cell:?}"), k + 1))
    };
    rows.records().enumerate().map(cell).collect()
}

fn of_parquet(file: File) -> Result<Vec<u32>, String> {
    let reader = SerializedFileReader::new(file).map_err(|why| why.to_string())?;
    let rows = reader.get_row_iter(None).map_err(|why| why.to_string())?;
    let cell = |(k, row): (usize, parquet::errors::Result<parquet::record::Row>)| {
        let row = row.map_err(|why| why.to_string())?;
        let found = row.get_column_iter().find(|(name, _)| *name == COLUMN).ok_or_else(missing)?.1;
        let number = match *found {
            Field::Int(number) => u32::try_from(number).ok(),
            Field::UInt(number) => Some(number),
            Field::Long(number) => u32::try_from(number).ok(),
            Field::ULong(number) => u32::try_from(number).ok(),
            _ => None,
        };
        number.ok_or_else(|| wrong(found, k + 1))
    };
    rows.enumerate().map(cell).collect()
}

#[cfg(test)]
mod tests {
    use super::run_ids;
    use crate::Columns;

    #[test]
    fn run_ids_are_read_from_both_formats_whatever_stands_beside_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("a.csv"), "plate,run_id\r\n\"x,y\",12\r\n,7\r\n").unwrap();
        assert_eq!(run_ids(&path("a.csv")).unwrap(), [12, 7]);
        let runs = [12_u32, 7];
        let table = Columns::of(&runs).text("plate", |_| None).unsigned("run_id", |run| Some(*run)).table();
        table.write_parquet(&mut std::fs::File::create(path("a.parquet")).unwrap()).unwrap();
        assert_eq!(run_ids(&path("a.parquet")).unwrap(), [12, 7]);

        std::fs::write(path("b.csv"), "plate\n1\n").unwrap();
        std::fs::write(path("c.csv"), "run_id\n1\n-2\n").unwrap();
        std::fs::write(path("d.parquet"), "run_id\n1\n").unwrap();
        let said = |name: &str| run_ids(&path(name)).unwrap_err().to_string();
        assert!(said("b.csv").contains("b.csv: has no column run_id"), "{}", said("b.csv"));
        assert!(said("c.csv").ends_with("row 2: found \"-2\" in the column run_id, expected a run id"));
        assert!(said("d.parquet").contains("d.parquet: "), "{}", said("d.parquet"));
    }
}
