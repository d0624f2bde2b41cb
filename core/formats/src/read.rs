//! Reader of scan files of any format, in two passes over the cells.
//!
//! 1. The first pass ([`ScanReader::orient`]) collects the sums from which the orientation is decided
//!    ([`crate::orient`]), and the CRC-32C of all ranges. The cells are decoded on a separate thread.
//! 2. The second pass ([`ScanReader::columns`]) delivers every column once, as soon as the file has completed it.
//!
//! Up to 3.1 million cells (104 MB) are kept from the first pass. A larger file is decoded twice, so that the memory is
//! bounded: sums per row and column, one bit per cell, and the columns that are not complete yet.

mod cells;
mod columns;
mod decode_ahead;
mod detect;
pub(crate) mod e57;
mod error;
mod lines;
mod ptx;
mod scan_order;
mod window;
pub(crate) mod xyb;
mod xyz;

use std::borrow::Cow;
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use platen_scan::ScanHeader;

use crate::format::Format;
use crate::orient::{Expected, Mirror, Plan, SphericalCells, Survey};
use cells::Cells;
use columns::Batches;

pub use columns::Columns;
pub use error::ReadError;
use error::Result;

#[cfg(test)]
pub(crate) use detect::format;

/// Properties of a scan that its file declares in addition to the cells.
#[derive(Debug, Clone, Default)]
struct About {
    /// Name of the format, with the encoding of the cells.
    format: String,
    /// Number of cells stored; an estimate for XYZ.
    cells: u64,
    /// Smallest and largest intensity declared.
    intensity: Option<(f64, f64)>,
    /// Set when the declared frame is left-handed.
    mirror: Mirror,
    /// Maker, model, serial number.
    instrument: String,
    /// Seconds since 1970 UTC.
    acquired_unix_s: Option<f64>,
    /// Header and warm-up columns from a file written by [`crate::ScanFile`].
    written: Option<(ScanHeader, u32)>,
    /// One sentence per decision made while opening.
    notes: Vec<String>,
}

/// A lattice in a file; its cells can be read any number of times.
trait Source: Send {
    /// Returns the declared properties.
    fn about(&self) -> &About;
    /// Starts at the first cell.
    fn cells(&mut self) -> Result<Box<dyn Cells + '_>>;
}

/// One scan of a file.
pub struct ScanReader<'a> {
    source: Box<dyn Source + 'a>,
    /// All cells, after a first pass over a small file.
    kept: SphericalCells,
}

/// Largest number of cells that are kept, 104 MB.
const MAX_KEPT: u64 = 3 << 20;
/// Number of cells between two reports of progress.
const PROGRESS_EVERY: u64 = 1 << 16;

impl<'a> ScanReader<'a> {
    /// Opens the scan in the file at `path` and checks that the file is complete: lengths, checksums, line counts.
    ///
    /// `cloud` counts from 1 and is required where a file holds several scans. Reading stops with an error as soon as
    /// `alive` returns false. The file is never locked or changed.
    ///
    /// # Errors
    /// Every variant of [`ReadError`] but [`ReadError::Orient`].
    pub fn open(path: &Path, cloud: Option<usize>, alive: &'a (dyn Fn() -> bool + Sync)) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let data = std::fs::metadata(path).map_err(ReadError::io("looking for the scan"))?;
        if data.is_dir() {
            return Err(detect::folder(&extension));
        }
        let file = File::open(path).map_err(ReadError::io("opening the scan"))?;
        let mut file = window::Window::new(file, alive);
        let mut head = Vec::new();
        let read = file.by_ref().take(detect::HEAD).read_to_end(&mut head);
        read.map_err(ReadError::io("reading the scan"))?;
        file.rewind().map_err(ReadError::io("going back to the start"))?;
        Self::new(file, detect::format(&head, &extension)?, cloud)
    }

    /// Opens a scan of known format; as [`ScanReader::open`].
    ///
    /// # Errors
    /// As [`ScanReader::open`].
    pub fn new(file: impl Read + Seek + Send + 'a, format: Format, cloud: Option<usize>) -> Result<Self> {
        let source: Box<dyn Source> = match format {
            Format::E57 => Box::new(e57::E57::open(file, cloud)?),
            Format::Ptx => Box::new(ptx::Ptx::open(file, cloud)?),
            Format::Xyz => Box::new(xyz::Xyz::open(file)?),
            Format::Xyb => Box::new(xyb::Xyb::open(file)?),
        };
        Ok(Self { source, kept: SphericalCells::default() })
    }

    /// Decides the orientation of the lattice (first pass). `known` contains the plant's declarations about the
    /// scanner. `progress` is called every 65,536 cells with the share read, 0 to 1; an error from it ends the pass.
    ///
    /// # Errors
    /// The error of `progress`, or a [`ReadError`].
    pub fn orient<E: From<ReadError>>(
        &mut self,
        known: &Expected,
        mut progress: impl FnMut(f64) -> std::result::Result<(), E>,
    ) -> std::result::Result<Oriented, E> {
        let about = self.source.about().clone();
        let (mut survey, mut checksum) = (Survey::default(), 0);
        // The declared number avoids keeping cells in vain; the real number is decisive.
        let mut fits = about.cells <= MAX_KEPT;
        let kept = &mut self.kept;
        *kept = SphericalCells::with_capacity(if fits { about.cells as usize } else { 0 });
        let (mut bytes, mut reported) = (Vec::new(), 0);
        decode_ahead::for_each(self.source.cells()?, |batch| {
            survey.add(batch).map_err(ReadError::from)?;
            checksum = continued_checksum(checksum, &batch.cells.range, &mut bytes);
            fits &= survey.cells() <= MAX_KEPT;
            if fits {
                kept.append(&batch.cells, 0..batch.cells.len(), &batch.cells.places);
            } else {
                *kept = SphericalCells::default();
            }
            if survey.cells() / PROGRESS_EVERY > reported {
                reported = survey.cells() / PROGRESS_EVERY;
                progress((survey.cells() as f64 / about.cells.max(1) as f64).min(1.0))?;
            }
            Ok::<(), E>(())
        })?;
        let mirror = if known.mirror == Mirror::None { about.mirror } else { known.mirror };
        let expected = Expected { intensity: about.intensity, mirror, ..*known };
        let mut plan = survey.decide(&expected).map_err(ReadError::from)?;
        let written = about.written.as_ref();
        if !written.is_some_and(|(header, warm_up_columns)| plan.restore(header, *warm_up_columns)) {
            plan.header.notes.splice(0..0, about.notes);
            plan.header.instrument = about.instrument;
            plan.header.acquired_unix_s = about.acquired_unix_s;
        }
        plan.header.notes.insert(0, format!("read from {}", about.format));
        Ok(Oriented { plan, checksum })
    }

    /// Returns the columns of the oriented lattice (second pass).
    ///
    /// # Errors
    /// When the file cannot be read from its start again.
    pub fn columns<'s>(&'s mut self, oriented: &'s Oriented) -> Result<Columns<'s>> {
        let batches: Batches<'s> = if self.kept.len() == 0 {
            let batches = cells::batches(self.source.cells()?);
            Box::new(batches.map(|batch| Ok(Cow::Owned(batch?.cells))))
        } else {
            Box::new(std::iter::once(Ok(Cow::Borrowed(&self.kept))))
        };
        Ok(Columns::new(&oriented.plan, batches))
    }
}

/// Result of the first pass.
#[derive(Debug)]
pub struct Oriented {
    plan: Plan,
    checksum: u32,
}

impl Oriented {
    /// Returns size, angles and notes of the lattice.
    pub fn header(&self) -> &ScanHeader {
        &self.plan.header
    }

    /// Returns the CRC-32C of the ranges of all cells. It is equal for copies of one scan under any name; two scans
    /// differ by their noise.
    pub fn checksum(&self) -> u32 {
        self.checksum
    }
}

/// Returns a CRC-32C continued over more numbers; `bytes` is a buffer for them.
fn continued_checksum(checksum: u32, numbers: &[f64], bytes: &mut Vec<u8>) -> u32 {
    bytes.resize(size_of_val(numbers), 0);
    let (slots, _) = bytes.as_chunks_mut();
    slots.iter_mut().zip(numbers).for_each(|(slot, number)| *slot = number.to_le_bytes());
    crc32c::crc32c_append(checksum, bytes)
}
