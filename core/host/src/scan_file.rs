//! Scans to files: structured E57, PTX, XYZ with row and column, XYB.
//!
//! Columns go into the file as they come, in any order, so that memory does not grow with the scan. The file appears
//! under its name when it is whole; a scan that fails, or a disk that is full, leaves nothing behind. The frame is the
//! scanner's: right-handed, z up, metres; row 0 at the top, columns by growing azimuth.
//!
//! E57 keeps ranges and directions to the last bit, with the scan's header in the description of its point cloud;
//! PTX and XYZ round to a micrometre; XYB and the text formats drop cells of which only the direction is known.

mod e57;
mod grid;
mod xyz;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use platen_scan::{Column, ScanEnd, ScanHeader, State};

use platen_engine::plugin::ScanEvent;

/// A format of lattices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// ASTM E2807, structured.
    E57,
    /// Leica's text format, all cells.
    Ptx,
    /// Text with row and column.
    Xyz,
    /// SCENE's binary format, all cells.
    Xyb,
}

/// Why there is no file.
#[derive(Debug, thiserror::Error)]
pub enum ScanFileError {
    /// The ending of the name says no format.
    #[error("{}: unknown format; let the name end in .e57, .ptx, .xyz or .xyb", .0.display())]
    Format(PathBuf),
    /// There is something in the way.
    #[error("{}: exists already; give another name or remove it", .0.display())]
    Exists(PathBuf),
    /// The system refuses.
    #[error("{}: cannot be written: {source}; check the folder and the space on its disk", .path.display())]
    Write {
        /// File.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The E57 library refuses.
    #[error("{}: cannot be written: {what}; check the folder and the space on its disk", .path.display())]
    E57 {
        /// File.
        path: PathBuf,
        /// The library's reason.
        what: String,
    },
    /// A text format has no room for a coordinate.
    #[error("{}: column {column} row {row} is {metres:.0} m away, beyond the format; write an E57", .path.display())]
    TooFar {
        /// File.
        path: PathBuf,
        /// Column.
        column: u32,
        /// Row.
        row: u32,
        /// Range.
        metres: f64,
    },
    /// The driver sent what is no scan.
    #[error("scan: {0}; report this to the driver's author")]
    NoScan(&'static str),
}

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Written {
    /// Rows of the lattice.
    pub rows: u32,
    /// Columns that came.
    pub columns: u32,
    /// Valid cells.
    pub points: u64,
    /// Size of the file.
    pub bytes: u64,
}

/// Takes the events of a scan.
pub type Sink<'a> = dyn FnMut(ScanEvent) -> ControlFlow<()> + 'a;

impl Format {
    /// The format that a file's name asks for.
    ///
    /// # Errors
    /// [`ScanFileError::Format`].
    pub fn of(path: &Path) -> Result<Self, ScanFileError> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("e57") => Ok(Self::E57),
            Some("ptx") => Ok(Self::Ptx),
            Some("xyz") => Ok(Self::Xyz),
            Some("xyb") => Ok(Self::Xyb),
            _ => Err(ScanFileError::Format(path.to_path_buf())),
        }
    }
}

/// How one format is written.
trait Encoder {
    fn begin(&mut self, header: &ScanHeader) -> Result<(), ScanFileError>;
    /// Any column, each once.
    fn column(&mut self, column: &Column) -> Result<(), ScanFileError>;
    fn end(&mut self, end: &ScanEnd) -> Result<(), ScanFileError>;
}

/// Writes the scan that `produce` makes. The file must not be there before.
///
/// # Errors
/// What `produce` says, or why there is no file; then nothing is left behind.
pub fn write<E: From<ScanFileError>>(
    path: &Path,
    produce: impl FnOnce(&mut Sink<'_>) -> Result<ScanEnd, E>,
) -> Result<Written, E> {
    let format = Format::of(path)?;
    if path.exists() {
        return Err(ScanFileError::Exists(path.to_path_buf()).into());
    }
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    let written = fill(&part, path, format, produce).and_then(|mut written| {
        let placed = std::fs::File::open(&part).and_then(|file| {
            file.sync_all()?;
            written.bytes = file.metadata()?.len();
            std::fs::rename(&part, path)
        });
        placed.map_err(failed(path))?;
        Ok(written)
    });
    if written.is_err() {
        // Whatever was written so far is of no use; what cannot be removed is named `.part`.
        let _ = std::fs::remove_file(&part);
    }
    written
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> ScanFileError + use<> {
    let path = path.to_path_buf();
    move |source| ScanFileError::Write { path: path.clone(), source }
}

fn fill<E: From<ScanFileError>>(
    part: &Path,
    path: &Path,
    format: Format,
    produce: impl FnOnce(&mut Sink<'_>) -> Result<ScanEnd, E>,
) -> Result<Written, E> {
    match format {
        Format::E57 => {
            let mut file = e57::File::create(part, path)?;
            let written = record(&mut file.cloud()?, produce)?;
            file.finish()?;
            Ok(written)
        }
        Format::Ptx => record(&mut grid::Grid::create(grid::Ptx, part, path)?, produce),
        Format::Xyb => record(&mut grid::Grid::create(grid::Xyb, part, path)?, produce),
        Format::Xyz => record(&mut xyz::Xyz::create(part, path)?, produce),
    }
}

/// From events to the encoder. A column that comes twice counts once.
fn record<E: From<ScanFileError>>(
    encoder: &mut dyn Encoder,
    produce: impl FnOnce(&mut Sink<'_>) -> Result<ScanEnd, E>,
) -> Result<Written, E> {
    let mut written = Written { rows: 0, columns: 0, points: 0, bytes: 0 };
    let (mut begun, mut came, mut wrong) = (false, Vec::new(), None);
    let mut take = |event| match event {
        ScanEvent::Begin(header) => {
            written.rows = header.n_rows;
            begun = true;
            encoder.begin(&header)
        }
        ScanEvent::Column(_) if !begun => Err(ScanFileError::NoScan("a column came before the header")),
        ScanEvent::Column(column) => {
            let index = column.index as usize;
            if came.len() <= index {
                came.resize(index + 1, false);
            }
            if std::mem::replace(&mut came[index], true) {
                return Ok(());
            }
            written.columns += 1;
            written.points += column.state.iter().filter(|state| **state == State::Valid).count() as u64;
            encoder.column(&column)
        }
    };
    let end = produce(&mut |event| match take(event) {
        Ok(()) => ControlFlow::Continue(()),
        Err(error) => {
            wrong = Some(error);
            ControlFlow::Break(())
        }
    });
    if let Some(error) = wrong {
        return Err(error.into());
    }
    let end = end?;
    if !begun {
        return Err(ScanFileError::NoScan("there was none").into());
    }
    encoder.end(&end)?;
    Ok(written)
}

/// Position of the `i`-th cell of a column when it is valid: metres, scanner frame.
fn point(column: &Column, i: usize) -> Option<[f64; 3]> {
    let direction = platen_scan::Direction { azimuth: column.azimuth[i], elevation: column.elevation[i] };
    (column.state[i] == State::Valid).then(|| direction.unit().map(|c| c * column.range_m[i]))
}

/// An intensity on the scale from `low` to `high`.
fn rescaled(intensity: u16, header: &ScanHeader, [low, high]: [f64; 2]) -> f64 {
    let (min, max) = header.intensity_range;
    if min >= max {
        return low;
    }
    let share = (f64::from(intensity) - f64::from(min)) / (f64::from(max) - f64::from(min));
    low + share.clamp(0.0, 1.0) * (high - low)
}
