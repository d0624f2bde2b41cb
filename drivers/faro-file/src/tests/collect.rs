//! Delivered columns as a lattice.

use std::path::{Path, PathBuf};

use platen_scan::orient::Expected;
use platen_scan::{Column, Lattice, ScanEnd, ScanHeader};

use crate::device::Reading;
use crate::error::{Error, Result};
use crate::source::Receiver;

/// Holds what was delivered, and insists on the order of begin, columns, end.
#[derive(Debug, Default)]
pub(super) struct Collected {
    pub(super) lattice: Option<Lattice>,
    pub(super) columns: u32,
    pub(super) end: Option<ScanEnd>,
}

impl Receiver for Collected {
    fn check(&mut self, fraction: f64, _: &str) -> Result<()> {
        assert!((0.0..=1.0).contains(&fraction), "progress {fraction}");
        Ok(())
    }

    fn begin(&mut self, header: &ScanHeader) -> Result<()> {
        assert!(self.lattice.is_none());
        self.lattice = Some(Lattice::new(header.clone()));
        Ok(())
    }

    fn column(&mut self, column: &Column) -> Result<()> {
        let lattice = self.lattice.as_mut().unwrap();
        assert_eq!(lattice.face(column.index as usize), None, "column {} came twice", column.index);
        lattice.push(column).unwrap();
        self.columns += 1;
        Ok(())
    }

    fn end(&mut self, end: &ScanEnd) -> Result<()> {
        assert!(self.end.is_none());
        self.end = Some(*end);
        Ok(())
    }
}

/// Reads a file to the end.
pub(super) fn read(path: &Path, chosen: Option<usize>) -> std::result::Result<Lattice, Error> {
    let mut collected = Collected::default();
    Reading { cloud: chosen, known: Expected::default() }.file(path, &mut collected, &|| true)?;
    let (lattice, end) = (collected.lattice.unwrap(), collected.end.unwrap());
    assert_eq!((collected.columns, lattice.n_columns()), (end.columns, end.columns as usize));
    assert_eq!(lattice.n_valid() as u64, end.points);
    Ok(lattice)
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
