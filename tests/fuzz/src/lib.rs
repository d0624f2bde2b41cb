//! What fuzz targets have in common: the file driver's parsers, and a limit on memory.
//!
//! The driver is a bare library that nobody links, so its modules are built here once more. Every run may allocate
//! what the longest lattice lines need, and so much for each byte of the input; an allocation beyond ends the
//! process, which the fuzzer reports with the input.

use std::alloc::System;
use std::io::Cursor;

use cap::Cap;
use platen_scan::orient::Expected;
use platen_scan::{Column, ScanEnd, ScanHeader};

#[path = "../../../drivers/faro-file/src/e57.rs"]
mod e57;
#[path = "../../../drivers/faro-file/src/error.rs"]
#[allow(dead_code, reason = "its texts for the watched folder are not used here")]
mod error;
#[path = "../../../drivers/faro-file/src/ptx.rs"]
mod ptx;
#[path = "../../../drivers/faro-file/src/regrid.rs"]
mod regrid;
#[path = "../../../drivers/faro-file/src/source.rs"]
mod source;
#[path = "../../../drivers/faro-file/src/text.rs"]
mod text;
#[path = "../../../drivers/faro-file/src/xyb.rs"]
#[allow(dead_code, reason = "its signature serves to tell formats apart")]
mod xyb;
#[path = "../../../drivers/faro-file/src/xyz.rs"]
#[allow(dead_code, reason = "its line tests serve to tell formats apart")]
mod xyz;

use error::Result;
use source::{Receiver, Source, deliver};

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

/// Sums for 131,072 rows and as many columns, and buffers for reading.
const LINES: usize = 64 << 20;
/// Memory that a byte of input justifies: a cell of a text file takes 8 of them.
const PER_BYTE: usize = 64;

/// Runs `work` with the memory that an input of `length` bytes justifies.
pub fn within(length: usize, work: impl FnOnce()) {
    let limit = MEMORY.allocated() + LINES + PER_BYTE * length;
    MEMORY.set_limit(limit).expect("more is allocated already");
    work();
    MEMORY.set_limit(usize::MAX).expect("the limit can be lifted");
}

/// Insists on a header, sound columns of it, each once, and an end that counts them.
#[derive(Default)]
struct Checked {
    header: Option<ScanHeader>,
    came: Vec<bool>,
    points: u64,
    end: Option<ScanEnd>,
}

impl Receiver for Checked {
    fn check(&mut self, _: f64, _: &str) -> Result<()> {
        Ok(())
    }

    fn begin(&mut self, header: &ScanHeader) -> Result<()> {
        assert!(self.header.is_none());
        self.came = vec![false; header.n_columns as usize];
        self.header = Some(header.clone());
        Ok(())
    }

    fn column(&mut self, column: &Column) -> Result<()> {
        let header = self.header.as_ref().expect("a header first");
        column.check(header.n_rows).expect("a sound column");
        assert!(!std::mem::replace(&mut self.came[column.index as usize], true), "a column came twice");
        self.points += column.state.iter().filter(|s| **s == platen_scan::State::Valid).count() as u64;
        Ok(())
    }

    fn end(&mut self, end: &ScanEnd) -> Result<()> {
        assert!(self.came.iter().all(|came| *came), "a column is missing");
        assert_eq!(self.points, end.points);
        self.end = Some(*end);
        Ok(())
    }
}

/// Any bytes give a lattice or an error in one line.
fn scan<'a>(data: &'a [u8], open: impl FnOnce(Cursor<&'a [u8]>) -> Result<Box<dyn Source + 'a>>) {
    within(data.len(), || {
        let mut checked = Checked::default();
        let read = open(Cursor::new(data))
            .and_then(|mut source| deliver(source.as_mut(), &Expected::default(), None, &mut checked));
        match read {
            Ok(_) => assert!(checked.end.is_some()),
            Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
        }
    });
}

/// E57 whose checksums and length are right, so that the damage reaches the parser.
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
    scan(&file, |file| Ok(Box::new(e57::E57::open(file, None)?)));
}

/// PTX.
pub fn ptx(data: &[u8]) {
    scan(data, |file| Ok(Box::new(ptx::Ptx::open(file, None)?)));
}

/// XYZ with row and column.
pub fn xyz(data: &[u8]) {
    scan(data, |file| Ok(Box::new(xyz::Xyz::open(file)?)));
}

/// XYB.
pub fn xyb(data: &[u8]) {
    scan(data, |file| Ok(Box::new(xyb::Xyb::open(file)?)));
}
