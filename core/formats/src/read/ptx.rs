//! Reader of PTX files (Leica's note of 2009): columns, points per column, position, axes, 4x4, one line per cell.
//!
//! The first number is that of the columns, the second that of the cells per column; the final decision is by the
//! geometry. A missing cell is a line with the coordinates `0 0 0`. The only protection of the content is the number of
//! lines. A file may contain several scans.

use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};

use platen_scan::State;

use super::cells::Cells;
use super::error::{ReadError, Result};
use super::lines::{self, Lines};
use super::{About, Source};
use crate::orient::{Mirror, Position, RawCell};

const FORMAT: &str = "PTX";
const HEADER_LINES: u64 = 10;
/// Shortest line of a cell, `0 0 0 0` and its end.
const SHORTEST_LINE: u64 = 8;
/// Buffer for reading.
const BUFFER: usize = 1 << 18;

/// One scan of a PTX file.
#[derive(Debug)]
pub(crate) struct Ptx<R> {
    file: R,
    part: Part,
    about: About,
}

/// Place and header of one scan in the file.
#[derive(Debug, Clone, PartialEq)]
struct Part {
    /// Offset of the first byte after the header.
    offset: u64,
    /// Number of the first line after the header, from 1.
    line: u64,
    columns: u32,
    per_column: u32,
    matrix: [[f64; 4]; 4],
    position: [f64; 3],
}

impl<R: Read + Seek> Ptx<R> {
    /// Counts the lines of the whole file and finds the scan; `chosen` counts from 1 and is optional when the file
    /// contains one scan.
    pub(crate) fn open(mut file: R, chosen: Option<usize>) -> Result<Self> {
        let length = file.seek(SeekFrom::End(0)).map_err(ReadError::io("finding the length"))?;
        file.rewind().map_err(ReadError::io("going back to the start"))?;
        let mut parts = parts(BufReader::with_capacity(BUFFER, &mut file), length)?;
        let held = parts.len();
        let part = match chosen {
            None if held == 1 => parts.swap_remove(0),
            None => {
                let size = |p: &Part| format!("{} x {} cells", p.per_column, p.columns);
                return Err(ReadError::Several(FORMAT, parts.iter().map(size).collect()));
            }
            Some(chosen) if (1..=held).contains(&chosen) => parts.swap_remove(chosen - 1),
            Some(chosen) => return Err(ReadError::NoSuchCloud(FORMAT, held, chosen)),
        };
        let about = part.describe();
        Ok(Self { file, part, about })
    }
}

impl<R: Read + Seek + Send> Source for Ptx<R> {
    fn about(&self) -> &About {
        &self.about
    }

    fn cells(&mut self) -> Result<Box<dyn Cells + '_>> {
        let Part { offset, line, columns, per_column, .. } = self.part;
        self.file.seek(SeekFrom::Start(offset)).map_err(ReadError::io("going to the scan"))?;
        let mut lines = Lines::new(BufReader::with_capacity(BUFFER, &mut self.file));
        lines.number = line - 1;
        let places = (0..columns).flat_map(move |column| (0..per_column).map(move |row| (row, column)));
        Ok(Box::new(places.map(move |(row, column)| {
            let (xyz, intensity) = cell(next(&mut lines)?)
                .ok_or_else(|| unsound(lines.number, "4, 7 or 10 numbers of a cell"))?;
            Ok(RawCell { row, column, position: Position::Cartesian(xyz), intensity, state: State::Valid })
        })))
    }
}

fn cell(line: &[u8]) -> Option<([f64; 3], f64)> {
    let (fields, n) = lines::fields(line);
    if !matches!(n, 4 | 7 | 10) {
        return None;
    }
    let [x, y, z, i] = [0, 1, 2, 3].map(|k| lines::number(fields[k]));
    Some(([x?, y?, z?], i?))
}

/// Returns the headers of all scans; counts every line of the file.
fn parts<R: BufRead>(reader: R, length: u64) -> Result<Vec<Part>> {
    let mut lines = Lines::new(reader);
    let mut parts = Vec::new();
    while let Some(first) = lines.next()? {
        if !parts.is_empty() && first.iter().all(u8::is_ascii_whitespace) {
            continue; // Blank lines may follow a scan.
        }
        let columns = lines::only_whole(first);
        let columns = columns.ok_or_else(|| unsound(lines.number, "the number of columns"))?;
        let part = header(columns, &mut lines)?;
        let cells = u64::from(part.columns) * u64::from(part.per_column);
        let needed = part.line - 1 + cells;
        if cells.saturating_mul(SHORTEST_LINE) > length.saturating_sub(part.offset) + 2 {
            return Err(incomplete(needed, format_args!("too few bytes for them, {length}")));
        }
        for _ in 0..cells {
            if lines.next()?.is_none() {
                return Err(incomplete(needed, format_args!("found {}", lines.number)));
            }
        }
        parts.push(part);
    }
    if parts.is_empty() { Err(incomplete(HEADER_LINES, format_args!("found 0"))) } else { Ok(parts) }
}

/// Reads the nine lines after the number of columns.
fn header<R: BufRead>(columns: u32, lines: &mut Lines<R>) -> Result<Part> {
    let per_column = lines::only_whole(next(lines)?);
    let per_column = per_column.ok_or_else(|| unsound(lines.number, "the cells per column"))?;
    let mut axes = [[0.0; 3]; 4];
    for axis in &mut axes {
        let numbers = lines::numbers(next(lines)?);
        *axis = numbers
            .ok_or_else(|| unsound(lines.number, "three numbers of the scanner's position or axes"))?;
    }
    let mut matrix = [[0.0; 4]; 4];
    for row in &mut matrix {
        let numbers = lines::numbers(next(lines)?);
        *row = numbers.ok_or_else(|| unsound(lines.number, "four numbers of the matrix"))?;
    }
    let position = axes[0];
    Ok(Part { offset: lines.offset, line: lines.number + 1, columns, per_column, matrix, position })
}

fn next<R: BufRead>(lines: &mut Lines<R>) -> Result<&[u8]> {
    let number = lines.number;
    lines.next()?.ok_or_else(|| incomplete(HEADER_LINES, format_args!("found {number}")))
}

fn unsound(line: u64, needed: &str) -> ReadError {
    ReadError::Unsound(FORMAT, format!("line {line} does not hold {needed}"))
}

fn incomplete(needed: u64, found: std::fmt::Arguments<'_>) -> ReadError {
    ReadError::Incomplete(FORMAT, format!("{needed} lines needed, {found}"))
}

impl Part {
    /// Returns the declared properties, including handedness and notes on the pose.
    ///
    /// The points are in the scanner's frame, so that the pose is not applied; only a mirroring matrix concerns the
    /// points themselves. Where position and matrix disagree the matrix is used.
    fn describe(&self) -> About {
        let mut notes = Vec::new();
        let [a, b, c, translation] = self.matrix;
        let determinant = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        if (determinant.abs() - 1.0).abs() > RIGID {
            notes.push(format!(
                "the file's matrix is not a rigid motion (determinant {determinant}): ignored"
            ));
        }
        let moved = translation[..3].iter().any(|t| *t != 0.0);
        if moved {
            notes.push(format!(
                "the file's pose (scanner at {} {} {} m) is not applied: the lattice stays in the scanner's frame",
                translation[0], translation[1], translation[2]
            ));
        }
        if (0..3).any(|k| (translation[k] - self.position[k]).abs() > SAME_PLACE) {
            let [x, y, z] = self.position;
            notes.push(format!("the file's matrix and its scanner position ({x} {y} {z}) disagree"));
        }
        let mirror = if determinant < -RIGID { Mirror::Y } else { Mirror::None };
        About {
            format: FORMAT.to_owned(),
            cells: u64::from(self.columns) * u64::from(self.per_column),
            intensity: Some((0.0, 1.0)),
            mirror,
            notes,
            ..About::default()
        }
    }
}

/// Largest distance from 1 of the determinant of a motion written with six decimals.
const RIGID: f64 = 1e-3;
/// Largest distance between the two statements of the scanner's position, metres.
const SAME_PLACE: f64 = 1e-3;
