//! Format detection from the first bytes of a file and its extension.
//!
//! A file is recognised by its signature, else by its extension, else by the count of numbers on the first lines.
//! Formats without a lattice, or that only their maker's software reads, are named and refused.

use std::io::BufReader;

use super::error::{ReadError, Result};
use super::lines::{self, Lines};
use super::{xyb, xyz};
use crate::format::Format;

/// Number of bytes from which a format is detected.
pub(super) const HEAD: u64 = 1 << 14;
/// Number of data lines of a text file that are examined.
const SAMPLE_LINES: usize = 20;

const STRUCTURED: &str =
    "export the scan as structured E57 (gridded, one scan, every point), PTX, or XYZ with row and column";

/// Returns the refusal of a folder.
pub(super) fn folder(extension: &str) -> ReadError {
    let (format, instead) = match extension {
        "fls" => (
            "FARO scan as a folder",
            "only the maker's software reads its points; import it into SCENE and export a structured E57",
        ),
        _ => ("a folder", "name the scan file itself"),
    };
    ReadError::Refused(format.to_owned(), instead)
}

/// First bytes of formats without a readable lattice.
const SIGNATURES: [(&[u8], &str); 9] = [
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "FARO .fls scan (compound file)"),
    (b"LASF", "LAS or LAZ point cloud, unorganised"),
    (b"ply", "PLY point cloud, unorganised"),
    (b"# .PCD", "PCD point cloud"),
    (b"PTG", "Leica PTG scan"),
    (b"\x1f\x8b", "gzip archive"),
    (b"PK\x03\x04", "zip archive"),
    (b"\x28\xb5\x2f\xfd", "zstd archive"),
    (b"7z\xbc\xaf\x27\x1c", "7z archive"),
];

/// Extensions of formats without a public signature.
const EXTENSIONS: [(&str, &str); 11] = [
    ("fls", "FARO .fls scan"),
    ("fws", "FARO SCENE workspace, which points to scans and holds none"),
    ("lsproj", "FARO SCENE project, which points to scans and holds none"),
    ("fds", "FARO .fds file"),
    ("pod", "POD point cloud, unorganised"),
    ("cpe", "FARO .cpe point cloud, not public"),
    ("las", "LAS point cloud, unorganised"),
    ("laz", "LAZ point cloud, unorganised"),
    ("rcp", "ReCap project"),
    ("rcs", "ReCap scan"),
    ("zfs", "Z+F scan"),
];

/// Detects the format of a file from its first [`HEAD`] bytes and its extension in lower case.
///
/// # Errors
/// [`ReadError::Refused`] for every other format, [`ReadError::Incomplete`] for no bytes.
pub(crate) fn format(head: &[u8], extension: &str) -> Result<Format> {
    if head.is_empty() {
        return Err(ReadError::Incomplete("scan", "0 bytes".to_owned()));
    }
    if head.starts_with(b"ASTM-E57") {
        return Ok(Format::E57);
    }
    if head.starts_with(xyb::SIGNATURE) {
        return Ok(Format::Xyb);
    }
    if let Some((_, format)) = SIGNATURES.iter().find(|(signature, _)| head.starts_with(signature)) {
        let instead = if format.contains("archive") { "unpack it first" } else { STRUCTURED };
        return Err(ReadError::Refused((*format).to_owned(), instead));
    }
    if let Some((_, format)) = EXTENSIONS.iter().find(|(known, _)| *known == extension) {
        return Err(ReadError::Refused((*format).to_owned(), STRUCTURED));
    }
    text_format(head, extension)
}

/// Distinguishes text formats by the count of numbers on their first lines.
fn text_format(head: &[u8], extension: &str) -> Result<Format> {
    let binary = head.contains(&0) || std::str::from_utf8(head).is_err_and(|e| e.error_len().is_some());
    let lines = if binary { Vec::new() } else { sample(head)? };
    let sizes: Vec<usize> = lines.iter().map(|line| line.numbers).collect();
    // A first line with one number is the number of points.
    let data = if sizes.first() == Some(&1) { &lines[1..] } else { &lines[..] };
    let unorganised =
        |what: &str| Err(ReadError::Refused(format!("{what}, unorganised (no row and column)"), STRUCTURED));
    match sizes.as_slice() {
        [1, 1] | [1, 1, 3, ..] => Ok(Format::Ptx),
        [1] if extension == "ptx" => Ok(Format::Ptx),
        [_, ..] if !data.is_empty() && data.iter().all(|line| line.cell) => Ok(Format::Xyz),
        [.., n] if extension == "pts" && *n >= 3 => unorganised("PTS point cloud"),
        [.., n] if *n >= 3 => unorganised("text point cloud"),
        _ => Err(ReadError::Refused("a file of unknown format".to_owned(), STRUCTURED)),
    }
}

/// A line of a text file.
struct Sampled {
    /// Count of numbers on the line.
    numbers: usize,
    /// True when they can be row, column and a point.
    cell: bool,
}

/// Returns the first lines that are not comments; none when one of them contains anything but numbers.
fn sample(head: &[u8]) -> Result<Vec<Sampled>> {
    // The last line is complete only when the file ends with it.
    let whole = if (head.len() as u64) < HEAD {
        head
    } else {
        head.rsplitn(2, |b| *b == b'\n').last().unwrap_or(head)
    };
    let mut lines = Lines::new(BufReader::new(whole));
    let mut sampled = Vec::new();
    while sampled.len() < SAMPLE_LINES
        && let Some(line) = lines.next()?
    {
        if xyz::is_comment(line) {
            continue;
        }
        let (fields, n) = lines::fields(line);
        if fields.iter().take(n).any(|field| lines::number(field).is_none()) {
            return Ok(Vec::new());
        }
        sampled.push(Sampled { numbers: n, cell: xyz::is_cell(line) });
    }
    Ok(sampled)
}
