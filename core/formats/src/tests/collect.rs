//! Delivered columns as a lattice.

use std::path::Path;

use platen_scan::Lattice;

use crate::orient::Expected;
use crate::{ReadError, ScanReader};

/// Reads a scan to the end and checks that every column is delivered once and that the trailer counts them.
pub(super) fn collect(mut reader: ScanReader<'_>, known: &Expected) -> Result<Lattice, ReadError> {
    let oriented = reader.orient(known, |share| {
        assert!((0.0..=1.0).contains(&share), "progress {share}");
        Ok::<_, ReadError>(())
    })?;
    let mut lattice = Lattice::new(oriented.header().clone());
    let mut columns = reader.columns(&oriented)?;
    let mut n_columns = 0;
    for column in &mut columns {
        let column = column?;
        assert_eq!(lattice.face(column.index as usize), None, "column {} came twice", column.index);
        lattice.push(&column).unwrap();
        n_columns += 1;
    }
    let end = columns.finish()?;
    assert_eq!((n_columns, lattice.n_columns()), (end.columns, end.columns as usize));
    assert_eq!(lattice.n_valid() as u64, end.points);
    Ok(lattice)
}

/// Reads a file to the end.
pub(super) fn read(path: &Path, chosen: Option<usize>) -> Result<Lattice, ReadError> {
    read_with(path, chosen, &Expected::default())
}

/// Reads a file to the end, with the plant's declarations about the scanner.
pub(super) fn read_with(path: &Path, chosen: Option<usize>, known: &Expected) -> Result<Lattice, ReadError> {
    collect(ScanReader::open(path, chosen, &|| true)?, known)
}
