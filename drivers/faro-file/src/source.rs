//! From any file to columns: two passes over its cells.

use platen_scan::orient::{Assembler, Expected, Mirror, Plan, RawCell, Survey};
use platen_scan::{Column, ScanEnd, ScanHeader};

use crate::error::{Error, Result};

/// What a file says of its scan besides the cells.
#[derive(Debug, Clone, Default)]
pub(crate) struct About {
    /// Name of the format, and how it holds the cells.
    pub(crate) format: String,
    /// Cells stored.
    pub(crate) cells: u64,
    /// Smallest and largest intensity declared.
    pub(crate) intensity: Option<(f64, f64)>,
    /// Set when the declared frame is left-handed.
    pub(crate) mirror: Mirror,
    /// Maker, model, serial number.
    pub(crate) instrument: String,
    /// Seconds since 1970 UTC.
    pub(crate) acquired_unix_s: Option<f64>,
    /// Header and warm-up columns of the scan that this program wrote to the file.
    pub(crate) own: Option<(ScanHeader, u32)>,
    /// One sentence for everything that was decided while opening.
    pub(crate) notes: Vec<String>,
}

/// Takes one cell after the other.
pub(crate) type Visit<'a> = dyn FnMut(&RawCell) -> Result<()> + 'a;

/// A lattice in a file, read as often as wanted.
pub(crate) trait Source {
    /// What the file says.
    fn about(&self) -> &About;
    /// Visits all cells in the order of the file.
    fn cells(&mut self, visit: &mut Visit<'_>) -> Result<()>;
}

/// Where a scan goes.
pub(crate) trait Receiver {
    /// Called often; an error ends the work.
    fn check(&mut self, fraction: f64, phase: &str) -> Result<()>;
    /// First.
    fn begin(&mut self, header: &ScanHeader) -> Result<()>;
    /// In any order.
    fn column(&mut self, column: &Column) -> Result<()>;
    /// Last.
    fn end(&mut self, end: &ScanEnd) -> Result<()>;
}

/// Cells of a small file, kept from the first pass for the second: decoding takes most of the time.
struct Remembered<'a> {
    source: &'a mut dyn Source,
    cells: Vec<RawCell>,
    complete: bool,
}

/// Most cells that are kept, 210 MB; a larger file is decoded twice.
const REMEMBERED: u64 = 5 << 19;

impl Remembered<'_> {
    fn cells(&mut self, visit: &mut Visit<'_>) -> Result<()> {
        if self.complete {
            return self.cells.iter().try_for_each(visit);
        }
        // The announced number spares memory; the real one has the last word.
        let mut fits = self.source.about().cells <= REMEMBERED;
        let kept = &mut self.cells;
        self.source.cells(&mut |cell| {
            fits &= (kept.len() as u64) < REMEMBERED;
            if fits {
                kept.push(*cell);
            }
            visit(cell)
        })?;
        if !fits {
            *kept = Vec::new();
        }
        self.complete = fits;
        Ok(())
    }
}

/// Cells between two looks at the receiver.
const CHECK_EVERY: u64 = 1 << 16;

/// First pass: decides what the cells are. `known` is what the plant says of the scanner.
fn survey(source: &mut Remembered<'_>, known: &Expected, out: &mut dyn Receiver) -> Result<(Plan, u32)> {
    let about = source.source.about().clone();
    let mut survey = Survey::default();
    let mut checksum = 0;
    source.cells(&mut |cell| {
        survey.add(cell)?;
        checksum = add_to_checksum(checksum, cell);
        watch(survey.cells(), &about, "looking at the lattice", out)
    })?;
    let mirror = if known.mirror == Mirror::None { about.mirror } else { known.mirror };
    let mut plan = survey.decide(&Expected { intensity: about.intensity, mirror, ..*known })?;
    let own = about.own.as_ref();
    if !own.is_some_and(|(header, warm_up_columns)| plan.take_over(header, *warm_up_columns)) {
        plan.header.notes.splice(0..0, about.notes);
        plan.header.instrument = about.instrument;
        plan.header.acquired_unix_s = about.acquired_unix_s;
    }
    plan.header.notes.insert(0, format!("read from {}", about.format));
    Ok((plan, checksum))
}

/// CRC-32C of the numbers of all cells: no two real scans agree in all of them.
fn add_to_checksum(checksum: u32, cell: &RawCell) -> u32 {
    let mut bytes = [0; 40];
    let [x, y, z] = cell.xyz;
    for (slot, number) in bytes.chunks_exact_mut(8).zip([x, y, z, cell.intensity]) {
        slot.copy_from_slice(&number.to_le_bytes());
    }
    bytes[32..36].copy_from_slice(&cell.row.to_le_bytes());
    bytes[36..].copy_from_slice(&cell.column.to_le_bytes());
    crc32c::crc32c_append(checksum, &bytes)
}

/// Both passes: decides, then delivers every column once, each as soon as the file completes it.
///
/// Returns the checksum of the cells; a scan with the checksum `before` is the one that was measured before.
pub(crate) fn deliver(
    source: &mut dyn Source,
    known: &Expected,
    before: Option<u32>,
    out: &mut dyn Receiver,
) -> Result<u32> {
    let about = source.about().clone();
    let mut source = Remembered { source, cells: Vec::new(), complete: false };
    let (plan, checksum) = survey(&mut source, known, out)?;
    if before == Some(checksum) {
        return Err(Error::Repeated);
    }
    out.begin(&plan.header)?;
    let mut assembler = Assembler::new(&plan);
    let mut seen = 0;
    source.cells(&mut |cell| {
        if let Some(column) = assembler.push(cell)? {
            out.column(&column)?;
        }
        seen += 1;
        watch(seen, &about, "reading columns", out)
    })?;
    let (empty, end) = assembler.finish()?;
    empty.iter().try_for_each(|column| out.column(column))?;
    out.end(&end)?;
    Ok(checksum)
}

fn watch(seen: u64, about: &About, phase: &str, out: &mut dyn Receiver) -> Result<()> {
    if seen.is_multiple_of(CHECK_EVERY) {
        out.check(seen as f64 / about.cells.max(1) as f64, phase)?;
    }
    Ok(())
}
