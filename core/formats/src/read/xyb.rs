//! Reader of XYB files (SCENE binary, version 1.0).
//!
//! The file consists of a text header, four zero bytes, then x, y, z as f64 and the reflectance as u16. There is no
//! count and no checksum; only the length of the file shows a cut record. `Rows` and `Cols` may be exchanged. Where the
//! number of records equals that of the cells, all cells are stored, and the geometry determines along which of the two
//! the records run. Otherwise only hits are stored, and rows and columns are recovered from the order of measurement
//! ([`super::scan_order`]).

use std::io::{BufReader, Read, Seek, SeekFrom};

use platen_scan::{Direction, State};

use super::cells::{Cells, batches};
use super::error::{ReadError, Result};
use super::scan_order::{self, Placed, Placer, Steps};
use super::{About, Source};
use crate::orient::{Expected, Position, RawCell, Survey};

const FORMAT: &str = "XYB";
/// First line, without its version.
pub(crate) const SIGNATURE: &[u8] = b"# SCENE XYZ binary";
/// Longest header, bytes.
const MAX_HEADER: u64 = 512;
const RECORD: usize = 26;
/// Full scale of the scanner's reflectance.
pub(crate) const REFLECTANCE: (f64, f64) = (0.0, 2047.0);
const BUFFER: usize = RECORD << 13;

/// One scan of an XYB file.
#[derive(Debug)]
pub(crate) struct Xyb<R> {
    file: R,
    offset: u64,
    order: Order,
    about: About,
}

/// Mapping of records to cells.
#[derive(Debug, Clone)]
enum Order {
    /// All cells, with the number of them per line.
    Lines(u32),
    /// Hits only, with the steps of the lattice and the lowest row among them.
    Hits(Steps, u32),
}

/// Length and sizes in the header.
struct Header {
    length: u64,
    rows: u32,
    columns: u32,
}

impl<R: Read + Seek + Send> Xyb<R> {
    /// Reads the header, checks the length and determines the mapping of records to cells.
    pub(crate) fn open(mut file: R) -> Result<Self> {
        let length = file.seek(SeekFrom::End(0)).map_err(ReadError::io("finding the length"))?;
        let header = header(&mut file)?;
        let bytes = length - header.length;
        if bytes == 0 || !bytes.is_multiple_of(RECORD as u64) {
            let what = format!("{bytes} bytes of points, a multiple of {RECORD} needed");
            return Err(ReadError::Incomplete(FORMAT, what));
        }
        let cells = bytes / RECORD as u64;
        let about =
            About { format: FORMAT.to_owned(), cells, intensity: Some(REFLECTANCE), ..About::default() };
        let lines = Order::Lines(header.rows);
        let mut xyb = Self { file, offset: header.length, order: lines, about };
        if u64::from(header.rows) * u64::from(header.columns) == cells {
            xyb.choose_lines(header.rows, header.columns)?;
        } else {
            let steps = xyb.steps()?;
            xyb.order = Order::Hits(steps.clone(), 0);
            let mut lowest = u32::MAX;
            for batch in batches(xyb.cells()?) {
                lowest = lowest.min(batch?.cells.places.lowest_row());
            }
            xyb.order = Order::Hits(steps, lowest);
            let note = "the file holds hits without row and column: placed by the order of their angles";
            xyb.about.notes.push(note.to_owned());
        }
        Ok(xyb)
    }

    /// Determines whether the records run along the header's rows or along its columns.
    fn choose_lines(&mut self, rows: u32, columns: u32) -> Result<()> {
        let mut first_error = None;
        for in_a_line in [rows, columns] {
            self.order = Order::Lines(in_a_line);
            let mut survey = Survey::default();
            for batch in batches(self.cells()?) {
                survey.add(&batch?)?;
            }
            match survey.decide(&Expected::default()) {
                Ok(_) => return Ok(()),
                Err(error) => first_error.get_or_insert(error),
            };
        }
        first_error.map_or(Ok(()), |error| Err(error.into()))
    }

    fn steps(&mut self) -> Result<Steps> {
        let mut reader = self.records()?;
        let mut hits = Vec::new();
        while let Some((xyz, _)) = next(&mut reader)?
            && hits.len() < scan_order::SAMPLE
        {
            if is_hit(xyz) {
                hits.push(Direction::of(xyz));
            }
        }
        Ok(Steps::estimate(&hits)?)
    }

    fn records(&mut self) -> Result<BufReader<&mut R>> {
        self.file.seek(SeekFrom::Start(self.offset)).map_err(ReadError::io("going to the points"))?;
        Ok(BufReader::with_capacity(BUFFER, &mut self.file))
    }
}

impl<R: Read + Seek + Send> Source for Xyb<R> {
    fn about(&self) -> &About {
        &self.about
    }

    fn cells(&mut self) -> Result<Box<dyn Cells + '_>> {
        let order = self.order.clone();
        let mut reader = self.records()?;
        match order {
            Order::Lines(in_a_line) => {
                let places = (0..).flat_map(move |column| (0..in_a_line).map(move |row| (row, column)));
                Ok(Box::new(places.map_while(move |place| {
                    let record = next(&mut reader).transpose()?;
                    Some(record.map(|record| cell(place, record)))
                })))
            }
            Order::Hits(steps, lowest) => {
                let mut placer = Some(Placer::new(steps));
                let mut placed = Vec::new().into_iter();
                Ok(Box::new(std::iter::from_fn(move || {
                    loop {
                        if let Some(Placed { row, column, record }) = placed.next() {
                            return Some(Ok(cell((row.saturating_sub(lowest), column), record)));
                        }
                        let column = match next(&mut reader) {
                            Ok(Some((xyz, _))) if !is_hit(xyz) => continue,
                            Ok(Some(record)) => placer.as_mut()?.push(Direction::of(record.0), record),
                            Ok(None) => placer.take()?.finish(),
                            Err(error) => return Some(Err(error)),
                        };
                        match column {
                            Ok(column) => placed = column.into_iter(),
                            Err(why) => return Some(Err(why.into())),
                        }
                    }
                })))
            }
        }
    }
}

/// Position and reflectance.
type Point = ([f64; 3], f64);

fn cell((row, column): (u32, u32), (xyz, intensity): Point) -> RawCell {
    RawCell { row, column, position: Position::Cartesian(xyz), intensity, state: State::Valid }
}

fn is_hit(xyz: [f64; 3]) -> bool {
    xyz.iter().all(|c| c.is_finite()) && xyz != [0.0; 3]
}

/// Failure of the recovery of rows and columns: the file is refused.
impl From<String> for ReadError {
    fn from(why: String) -> Self {
        let format = format!("XYB file of hits alone ({why})");
        Self::Refused(format, "export it again with all cells, or as structured E57")
    }
}

/// Reads the next record, `None` after the last.
fn next<R: Read>(reader: &mut R) -> Result<Option<Point>> {
    let mut record = [0; RECORD];
    let mut filled = 0;
    while filled < RECORD {
        match reader.read(&mut record[filled..]).map_err(ReadError::io("reading points"))? {
            0 if filled == 0 => return Ok(None),
            0 => return Err(ReadError::Incomplete(FORMAT, "a record is cut".to_owned())),
            n => filled += n,
        }
    }
    let number = |at: usize| {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&record[at..at + 8]);
        f64::from_le_bytes(bytes)
    };
    let reflectance = u16::from_le_bytes([record[24], record[25]]);
    Ok(Some(([number(0), number(8), number(16)], f64::from(reflectance))))
}

fn header<R: Read + Seek>(file: &mut R) -> Result<Header> {
    file.rewind().map_err(ReadError::io("going back to the start"))?;
    let mut head = Vec::new();
    file.by_ref().take(MAX_HEADER).read_to_end(&mut head).map_err(ReadError::io("reading the header"))?;
    let end = head.windows(4).position(|four| four == [0; 4]);
    let Some(end) = end else {
        let what = format!("no end of the header in {} bytes", head.len());
        return Err(ReadError::Incomplete(FORMAT, what));
    };
    let text = String::from_utf8_lossy(&head[..end]);
    let size = |name: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(name));
        line.and_then(|number| number.trim().parse().ok())
            .ok_or_else(|| ReadError::Unsound(FORMAT, format!("its header does not contain {name}")))
    };
    Ok(Header { length: end as u64 + 4, rows: size("Rows")?, columns: size("Cols")? })
}
