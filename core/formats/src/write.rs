//! Writer of scan files, column by column in any order, in bounded memory.
//!
//! The file is written under a temporary name in the same folder, synced and renamed when it is complete. A scan that
//! fails, or a full disk, leaves no file behind, and an existing file is never replaced. The frame is the scanner's:
//! right-handed, z up, metres; row 0 at the top, columns by increasing azimuth.
//!
//! E57 keeps ranges and directions to the last bit, with the scan's header in the description of its point cloud; PTX
//! and XYZ round to a micrometre; PTX, XYZ and XYB drop cells of which only the direction is known.

mod e57;
mod error;
mod grid;
mod xyz;

use std::ffi::OsString;
use std::fs::{File, Permissions};
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};

use ::e57::E57Writer;
use platen_scan::{Column, Direction, ScanEnd, ScanHeader, State};
use tempfile::NamedTempFile;

use crate::format::Format;
use error::Result;
pub use error::{WriteError, WriteFault};

impl Format {
    /// Returns the format for the extension of `path`.
    ///
    /// # Errors
    /// [`WriteError::Format`] for any other extension.
    pub fn of(path: &Path) -> std::result::Result<Self, WriteError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("e57") => Ok(Self::E57),
            Some("ptx") => Ok(Self::Ptx),
            Some("xyz") => Ok(Self::Xyz),
            Some("xyb") => Ok(Self::Xyb),
            _ => Err(WriteError::Format(path.to_path_buf())),
        }
    }
}

/// A new scan file under its temporary name. Dropping it before [`ScanFile::persist`] removes it.
///
/// ```no_run
/// # use platen_formats::{ScanFile, WriteError};
/// # use platen_scan::{Column, ScanEnd, ScanHeader};
/// # fn write(header: &ScanHeader, columns: &[Column], end: &ScanEnd) -> Result<(), WriteError> {
/// let mut file = ScanFile::create("scan.e57".as_ref())?;
/// let mut writer = file.writer(header)?;
/// columns.iter().try_for_each(|column| writer.push(column))?;
/// let written = writer.finish(end)?;
/// file.persist(written)?;
/// # Ok(())
/// # }
/// ```
pub struct ScanFile {
    path: PathBuf,
    part: NamedTempFile,
    encoding: Encoding,
}

/// Format, with the state that is kept beyond the point cloud.
enum Encoding {
    E57(Box<E57Writer<File>>),
    Ptx,
    Xyz,
    Xyb,
}

impl Encoding {
    fn start(&mut self, file: &File, header: &ScanHeader) -> Result<Box<dyn Encoder + '_>> {
        let file = file.try_clone()?;
        Ok(match self {
            Self::E57(writer) => Box::new(e57::Cloud::new(writer, header)?),
            Self::Ptx => Box::new(grid::Grid::new(grid::Ptx, file, header)),
            Self::Xyb => Box::new(grid::Grid::new(grid::Xyb, file, header)),
            Self::Xyz => Box::new(xyz::Xyz::new(file)),
        })
    }
}

/// Size of a file written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Written {
    /// Number of rows of the lattice.
    pub rows: u32,
    /// Number of distinct columns pushed.
    pub columns: u32,
    /// Number of valid cells.
    pub points: u64,
    /// Number of bytes, 0 before [`ScanFile::persist`].
    pub bytes: u64,
}

impl ScanFile {
    /// Creates the file; its format follows the extension.
    ///
    /// # Errors
    /// Unknown extension, an existing file, or the reason of the operating system.
    pub fn create(path: &Path) -> std::result::Result<Self, WriteError> {
        let format = Format::of(path)?;
        if path.exists() {
            return Err(WriteError::Exists(path.to_path_buf()));
        }
        let create = || {
            // As `File::create`: readable for all who may read the folder's files, within the umask.
            let permissions = Permissions::from_mode(0o666);
            let mut prefix = path.file_name().map_or_else(OsString::new, OsString::from);
            prefix.push(format!(".{}.", std::process::id()));
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            let part = tempfile::Builder::new()
                .prefix(&prefix)
                .suffix(".part")
                .permissions(permissions)
                .tempfile_in(folder.unwrap_or(Path::new(".")))?;
            let encoding = match format {
                Format::E57 => Encoding::E57(Box::new(e57::begin(part.as_file().try_clone()?)?)),
                Format::Ptx => Encoding::Ptx,
                Format::Xyz => Encoding::Xyz,
                Format::Xyb => Encoding::Xyb,
            };
            Ok(Self { path: path.to_path_buf(), part, encoding })
        };
        create().map_err(WriteError::at(path))
    }

    /// Starts the single scan of the file.
    ///
    /// # Errors
    /// The reason of the operating system or of the E57 library.
    pub fn writer(&mut self, header: &ScanHeader) -> std::result::Result<ScanWriter<'_>, WriteError> {
        let encoder = self.encoding.start(self.part.as_file(), header).map_err(WriteError::at(&self.path))?;
        let came = vec![false; header.n_columns as usize];
        let written = Written { rows: header.n_rows, columns: 0, points: 0, bytes: 0 };
        Ok(ScanWriter { path: &self.path, encoder, came, written })
    }

    /// Gives the file its name, after [`ScanWriter::finish`].
    ///
    /// # Errors
    /// [`WriteError::Exists`] when a file of that name appeared meanwhile, or the reason of the operating system.
    pub fn persist(self, written: Written) -> std::result::Result<Written, WriteError> {
        let Self { path, part, encoding } = self;
        let sync = || {
            if let Encoding::E57(mut writer) = encoding {
                writer.finalize()?;
            }
            part.as_file().sync_all()?;
            Ok(part.as_file().metadata()?.len())
        };
        let bytes = sync().map_err(WriteError::at(&path))?;
        match part.persist_noclobber(&path).map_err(|e| e.error) {
            Ok(_) => Ok(Written { bytes, ..written }),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => Err(WriteError::Exists(path)),
            Err(error) => Err(WriteError::at(&path)(error.into())),
        }
    }
}

/// Encoding of one format.
trait Encoder {
    /// Writes a column; each once, in any order.
    fn column(&mut self, column: &Column) -> Result<()>;
    /// Ends the scan; `came` has one entry per column of the lattice, true for columns that were written.
    fn end(&mut self, end: &ScanEnd, came: &[bool]) -> Result<()>;
}

/// Writer of the columns of one scan.
pub struct ScanWriter<'a> {
    path: &'a Path,
    encoder: Box<dyn Encoder + 'a>,
    came: Vec<bool>,
    written: Written,
}

impl ScanWriter<'_> {
    /// Writes a column that passes [`Column::check`]. A column that was written before is ignored.
    ///
    /// # Errors
    /// The reason of the operating system, or a cell out of the range of the format.
    pub fn push(&mut self, column: &Column) -> std::result::Result<(), WriteError> {
        let index = column.index as usize;
        if self.came.len() <= index {
            self.came.resize(index + 1, false);
        }
        if std::mem::replace(&mut self.came[index], true) {
            return Ok(());
        }
        self.written.columns += 1;
        self.written.points += column.state.iter().filter(|state| **state == State::Valid).count() as u64;
        self.encoder.column(column).map_err(WriteError::at(self.path))
    }

    /// Ends the scan; missing columns are filled in where the format requires it.
    ///
    /// # Errors
    /// The reason of the operating system.
    pub fn finish(mut self, end: &ScanEnd) -> std::result::Result<Written, WriteError> {
        self.encoder.end(end, &self.came).map_err(WriteError::at(self.path))?;
        Ok(self.written)
    }
}

/// Returns the position of the `i`-th cell of a column when it is valid: metres, scanner frame.
fn point(column: &Column, i: usize) -> Option<[f64; 3]> {
    let direction = Direction { azimuth: column.azimuth[i], elevation: column.elevation[i] };
    (column.state[i] == State::Valid).then(|| direction.unit().map(|c| c * column.range_m[i]))
}

/// Maps an intensity linearly to the scale from `low` to `high`.
fn rescaled(intensity: u16, (min, max): (u16, u16), [low, high]: [f64; 2]) -> f64 {
    if min >= max {
        return low;
    }
    let share = (f64::from(intensity) - f64::from(min)) / (f64::from(max) - f64::from(min));
    low + share.clamp(0.0, 1.0) * (high - low)
}
