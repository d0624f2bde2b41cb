//! Reader of XYZ text with row and column, as SCENE exports it: `row col x y z [reflectance] [r g b [reflectance]]`.
//!
//! Missing cells are left out, so that the size of the lattice is known at the end only. The first line may be the
//! number of points; lines that begin with `#` or `//` are comments. Without a count the only protection of the content
//! is the end of the last line.

use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};

use platen_scan::State;

use super::cells::Cells;
use super::error::{ReadError, Result};
use super::lines::{self, Lines};
use super::{About, Source};
use crate::orient::{Position, RawCell};

const FORMAT: &str = "XYZ";
/// Buffer for reading.
const BUFFER: usize = 1 << 18;

/// One scan in a text file.
#[derive(Debug)]
pub(crate) struct Xyz<R> {
    file: R,
    about: About,
}

impl<R: Read + Seek> Xyz<R> {
    /// Estimates the number of points from the length of the file.
    pub(crate) fn open(mut file: R) -> Result<Self> {
        let length = file.seek(SeekFrom::End(0)).map_err(ReadError::io("finding the length"))?;
        let cells = length / TYPICAL_LINE;
        let format = "XYZ with row and column".to_owned();
        Ok(Self { file, about: About { format, cells, ..About::default() } })
    }
}

/// Number of bytes of a line, for the estimate.
const TYPICAL_LINE: u64 = 40;

impl<R: Read + Seek + Send> Source for Xyz<R> {
    fn about(&self) -> &About {
        &self.about
    }

    fn cells(&mut self) -> Result<Box<dyn Cells + '_>> {
        self.file.rewind().map_err(ReadError::io("going back to the start"))?;
        let lines = Lines::new(BufReader::with_capacity(BUFFER, &mut self.file));
        let mut points = Points { lines, announced: None, width: None, seen: 0 };
        Ok(Box::new(std::iter::from_fn(move || points.next().transpose())))
    }
}

/// The points of a file, line after line.
struct Points<R> {
    lines: Lines<R>,
    /// Number of points on the first line, where there is one.
    announced: Option<u32>,
    /// Count of numbers on the first line of a point; all others have the same.
    width: Option<usize>,
    seen: u64,
}

impl<R: BufRead> Points<R> {
    fn next(&mut self) -> Result<Option<RawCell>> {
        let lines = &mut self.lines;
        while let Some(line) = lines.next()? {
            if is_comment(line) {
                continue;
            }
            if self.width.is_none() && self.announced.is_none() {
                self.announced = lines::only_whole(line);
                if self.announced.is_some() {
                    continue;
                }
            }
            let (fields, n) = lines::fields(line);
            let cell = cell(&fields, n).filter(|_| *self.width.get_or_insert(n) == n);
            if !lines.ended {
                return Err(cut(lines, "ends in the middle of a line"));
            }
            self.seen += 1;
            return cell.map(Some).ok_or_else(|| unsound(lines, self.width));
        }
        match self.announced {
            Some(needed) if self.seen < u64::from(needed) => {
                Err(cut(lines, &format!("{} points, {needed} announced", self.seen)))
            }
            _ if self.seen == 0 => Err(cut(lines, "no points")),
            _ => Ok(None),
        }
    }
}

/// Returns whether a line is blank or a comment.
pub(crate) fn is_comment(line: &[u8]) -> bool {
    line.starts_with(b"#") || line.starts_with(b"//") || line.iter().all(u8::is_ascii_whitespace)
}

/// Returns whether the numbers of a line can be row, column and a point.
pub(crate) fn is_cell(line: &[u8]) -> bool {
    let (fields, n) = lines::fields(line);
    cell(&fields, n).is_some()
}

fn cell(fields: &[&[u8]; lines::MAX_FIELDS], n: usize) -> Option<RawCell> {
    let intensity = match n {
        5 | 8 => None,
        6 => Some(5),
        9 => Some(8),
        _ => return None,
    };
    let (row, column) = (lines::whole(fields[0])?, lines::whole(fields[1])?);
    let xyz = [lines::number(fields[2])?, lines::number(fields[3])?, lines::number(fields[4])?];
    let intensity = intensity.map_or(Some(0.0), |k| lines::number(fields[k]))?;
    Some(RawCell { row, column, position: Position::Cartesian(xyz), intensity, state: State::Valid })
}

fn cut<R>(lines: &Lines<R>, what: &str) -> ReadError {
    ReadError::Incomplete(FORMAT, format!("line {}: {what}", lines.number))
}

fn unsound<R>(lines: &Lines<R>, width: Option<usize>) -> ReadError {
    let needed = width.map_or_else(|| "5, 6, 8 or 9".to_owned(), |n| n.to_string());
    let what = format!("line {} does not hold row, column and a point in {needed} numbers", lines.number);
    ReadError::Unsound(FORMAT, what)
}
