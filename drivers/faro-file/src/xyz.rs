//! XYZ text with row and column, as SCENE exports it: `row col x y z [reflectance] [r g b [reflectance]]`.
//!
//! Missing cells are left out, so that the lattice has gaps and its size is only known at the end. A first line
//! may hold the number of points; lines that begin with `#` or `//` are comments. Without such a count nothing
//! protects the content but the end of the last line.

use std::io::{BufReader, Read, Seek, SeekFrom};

use platen_scan::State;
use platen_scan::orient::RawCell;

use crate::error::{Error, Result};
use crate::source::{About, Source, Visit};
use crate::text::{self, Lines};

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
    /// Estimates the number of points from the first kilobytes.
    pub(crate) fn open(mut file: R) -> Result<Self> {
        let length = file.seek(SeekFrom::End(0)).map_err(Error::io("finding the length"))?;
        let cells = length / TYPICAL_LINE;
        let format = "XYZ with row and column".to_owned();
        Ok(Self { file, about: About { format, cells, ..About::default() } })
    }
}

/// Bytes of a line by which progress is told.
const TYPICAL_LINE: u64 = 40;

impl<R: Read + Seek> Source for Xyz<R> {
    fn about(&self) -> &About {
        &self.about
    }

    fn cells(&mut self, visit: &mut Visit<'_>) -> Result<()> {
        self.file.rewind().map_err(Error::io("going back to the start"))?;
        let mut lines = Lines::new(BufReader::with_capacity(BUFFER, &mut self.file));
        let (mut announced, mut width, mut seen) = (None, None, 0_u64);
        while let Some(line) = lines.next()? {
            if is_comment(line) {
                continue;
            }
            if width.is_none() && announced.is_none() {
                announced = text::only_whole(line);
                if announced.is_some() {
                    continue;
                }
            }
            let (fields, n) = text::fields(line);
            let cell = cell(&fields, n).filter(|_| *width.get_or_insert(n) == n);
            let ended = lines.ended;
            match cell {
                Some(cell) if ended => visit(&cell)?,
                _ if !ended => return Err(cut(&lines, "ends in the middle of a line")),
                _ => return Err(unsound(&lines, width)),
            }
            seen += 1;
        }
        match announced {
            Some(needed) if seen < u64::from(needed) => {
                Err(cut(&lines, &format!("{seen} points, {needed} announced")))
            }
            _ if seen == 0 => Err(cut(&lines, "no points")),
            _ => Ok(()),
        }
    }
}

/// True for lines that hold no point by intention.
pub(crate) fn is_comment(line: &[u8]) -> bool {
    line.starts_with(b"#") || line.starts_with(b"//") || line.iter().all(u8::is_ascii_whitespace)
}

/// True when the numbers of a line can be row, column and a point.
pub(crate) fn is_cell(line: &[u8]) -> bool {
    let (fields, n) = text::fields(line);
    cell(&fields, n).is_some()
}

fn cell(fields: &[&[u8]; text::MAX_FIELDS], n: usize) -> Option<RawCell> {
    let intensity = match n {
        5 | 8 => None,
        6 => Some(5),
        9 => Some(8),
        _ => return None,
    };
    let (row, column) = (text::whole(fields[0])?, text::whole(fields[1])?);
    let xyz = [text::number(fields[2])?, text::number(fields[3])?, text::number(fields[4])?];
    let intensity = intensity.map_or(Some(0.0), |k| text::number(fields[k]))?;
    Some(RawCell { row, column, xyz, beam: None, intensity, state: State::Valid })
}

fn cut<R>(lines: &Lines<R>, what: &str) -> Error {
    Error::Incomplete { format: FORMAT, what: format!("line {}: {what}", lines.number) }
}

fn unsound<R>(lines: &Lines<R>, width: Option<usize>) -> Error {
    let needed = width.map_or_else(|| "5, 6, 8 or 9".to_owned(), |n| n.to_string());
    let what = format!("line {} does not hold row, column and a point in {needed} numbers", lines.number);
    Error::Unsound { format: FORMAT, what }
}
