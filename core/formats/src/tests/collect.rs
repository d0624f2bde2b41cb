//! Delivered columns as a lattice.

use std::path::{Path, PathBuf};

use platen_scan::Lattice;

use crate::orient::Expected;
use crate::{ReadError, ScanReader};

/// Reads a scan to the end and checks that every column comes once and that the end counts them.
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

/// Reads a file to the end, with what the plant declares about the scanner.
pub(super) fn read_with(path: &Path, chosen: Option<usize>, known: &Expected) -> Result<Lattice, ReadError> {
    collect(ScanReader::open(path, chosen, &|| true)?, known)
}

/// The folder of samples; `None`, said once, when it is not there.
pub(super) fn samples() -> Option<PathBuf> {
    let own = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/samples");
    let folder = std::env::var_os("PLATEN_SAMPLES").map_or(own, PathBuf::from);
    if folder.is_dir() {
        Some(folder)
    } else {
        eprintln!("left out: no samples in {} (set PLATEN_SAMPLES)", folder.display());
        None
    }
}

/// A sample, unpacked when it is a gzip file, under its own name in `folder`.
pub(super) fn unpacked(sample: &Path, folder: &Path) -> PathBuf {
    if sample.extension().is_none_or(|e| e != "gz") {
        return sample.to_owned();
    }
    let target = folder.join(sample.file_stem().unwrap());
    let out = std::fs::File::create(&target).unwrap();
    let status = std::process::Command::new("gzip").arg("-dc").arg(sample).stdout(out).status().unwrap();
    assert!(status.success(), "gzip -dc {}", sample.display());
    target
}
