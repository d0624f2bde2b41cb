//! Common parts of the fuzz targets: scans of the file formats, and a limit on memory.
//!
//! Every run may allocate the memory that the longest lattice lines need, and a fixed amount for each byte of input. A
//! larger allocation ends the process, which the fuzzer reports with the input.

use std::alloc::System;
use std::io::Cursor;

use cap::Cap;
use platen_formats::orient::Expected;
use platen_formats::{Format, ReadError, ScanReader};

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

/// Sums for 131,072 rows and as many columns, and buffers for reading.
const LINES: usize = 64 << 20;
/// Memory allowed for a byte of input: a cell of a text file takes 8 bytes.
const PER_BYTE: usize = 64;

/// Runs `work` with the memory allowed for an input of `length` bytes.
pub fn within(length: usize, work: impl FnOnce()) {
    let limit = MEMORY.allocated() + LINES + PER_BYTE * length;
    MEMORY.set_limit(limit).expect("more is allocated already");
    work();
    MEMORY.set_limit(usize::MAX).expect("the limit can be lifted");
}

/// Checks that any bytes give a lattice with valid columns, each once, or an error in one line.
fn scan(data: &[u8], format: Format) {
    within(data.len(), || {
        if let Err(error) = ScanReader::new(Cursor::new(data), format, None).and_then(check) {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    });
}

fn check(mut reader: ScanReader<'_>) -> Result<(), ReadError> {
    let oriented = reader.orient(&Expected::default(), |_| Ok::<_, ReadError>(()))?;
    let header = oriented.header();
    let (mut came, mut points) = (vec![false; header.n_columns as usize], 0);
    let mut columns = reader.columns(&oriented)?;
    for column in &mut columns {
        let column = column?;
        column.check(header.n_rows).expect("a sound column");
        assert!(!std::mem::replace(&mut came[column.index as usize], true), "a column came twice");
        points += column.state.iter().filter(|s| **s == platen_scan::State::Valid).count() as u64;
    }
    assert!(came.iter().all(|came| *came), "a column is missing");
    assert_eq!(points, columns.finish()?.points);
    Ok(())
}

/// Runs E57 with corrected checksums and length, so that the damage reaches the parser.
pub fn e57(data: &[u8]) {
    let mut file = data.to_vec();
    file.truncate(file.len() / 1024 * 1024);
    if file.len() < 1024 {
        return;
    }
    let length = file.len() as u64;
    file[16..24].copy_from_slice(&length.to_le_bytes());
    for page in file.chunks_exact_mut(1024) {
        let crc = crc32c::crc32c(&page[..1020]);
        page[1020..].copy_from_slice(&crc.to_be_bytes());
    }
    scan(&file, Format::E57);
}

/// Runs PTX.
pub fn ptx(data: &[u8]) {
    scan(data, Format::Ptx);
}

/// Runs XYZ with row and column.
pub fn xyz(data: &[u8]) {
    scan(data, Format::Xyz);
}

/// Runs XYB.
pub fn xyb(data: &[u8]) {
    scan(data, Format::Xyb);
}
