//! What a file is, told from its content, and the reader for it.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use crate::e57::E57;
use crate::error::{Error, Result};
use crate::ptx::Ptx;
use crate::source::Source;
use crate::text::{self, Lines};
use crate::window::Window;
use crate::xyb::{self, Xyb};
use crate::xyz::{self, Xyz};

/// Bytes from which a format is told.
const HEAD: u64 = 1 << 14;
/// Data lines of a text file that are looked at.
const SAMPLE_LINES: usize = 20;

const STRUCTURED: &str =
    "export the scan as structured E57 (gridded, one scan, every point), PTX, or XYZ with row and column";

/// What is done with a file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind {
    E57,
    Ptx,
    Xyz,
    Xyb,
    /// Recognised and refused: what it is, what to do instead.
    Refused(String, &'static str),
}

/// Opens the scan in the file at `path`; `chosen` counts from 1 where a file holds several. Reading ends with an
/// error when `alive` says no.
pub(crate) fn open<'a>(
    path: &Path,
    chosen: Option<usize>,
    alive: &'a dyn Fn() -> bool,
) -> Result<Box<dyn Source + 'a>> {
    let data = std::fs::metadata(path).map_err(Error::io("looking for the scan"))?;
    if data.is_dir() {
        let (format, instead) = folder(path);
        return Err(Error::Refused { format, instead });
    }
    let file = File::open(path).map_err(Error::io("opening the scan"))?;
    let mut file = Window::new(file, alive);
    let mut head = Vec::new();
    file.by_ref().take(HEAD).read_to_end(&mut head).map_err(Error::io("reading the scan"))?;
    file.rewind().map_err(Error::io("going back to the start"))?;
    match kind(&head, &extension(path))? {
        Kind::E57 => Ok(Box::new(E57::open(file, chosen)?)),
        Kind::Ptx => Ok(Box::new(Ptx::open(file, chosen)?)),
        Kind::Xyz => Ok(Box::new(Xyz::open(file)?)),
        Kind::Xyb => Ok(Box::new(Xyb::open(file)?)),
        Kind::Refused(format, instead) => Err(Error::Refused { format, instead }),
    }
}

/// File name extension in lower case, empty when there is none.
fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

fn folder(path: &Path) -> (String, &'static str) {
    match extension(path).as_str() {
        "fls" => (
            "FARO scan as a folder".to_owned(),
            "only the maker's software reads its points; import it into SCENE and export a structured E57",
        ),
        _ => ("a folder".to_owned(), "name the scan file itself"),
    }
}

/// First bytes that name a format for certain.
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

/// Extensions of formats that have no signature known in public.
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

/// Tells the format from the first bytes and, where these say nothing, from the extension.
pub(crate) fn kind(head: &[u8], extension: &str) -> Result<Kind> {
    if head.is_empty() {
        return Err(Error::Incomplete { format: "scan", what: "0 bytes".to_owned() });
    }
    if head.starts_with(b"ASTM-E57") {
        return Ok(Kind::E57);
    }
    if head.starts_with(xyb::SIGNATURE) {
        return Ok(Kind::Xyb);
    }
    if let Some((_, format)) = SIGNATURES.iter().find(|(signature, _)| head.starts_with(signature)) {
        let instead = if format.contains("archive") { "unpack it first" } else { STRUCTURED };
        return Ok(Kind::Refused((*format).to_owned(), instead));
    }
    if let Some((_, format)) = EXTENSIONS.iter().find(|(known, _)| *known == extension) {
        return Ok(Kind::Refused((*format).to_owned(), STRUCTURED));
    }
    text_kind(head, extension)
}

/// Tells text formats apart by the numbers of their first lines.
fn text_kind(head: &[u8], extension: &str) -> Result<Kind> {
    let binary = head.contains(&0) || std::str::from_utf8(head).is_err_and(|e| e.error_len().is_some());
    let lines = if binary { Vec::new() } else { sample(head)? };
    let sizes: Vec<usize> = lines.iter().map(|line| line.numbers).collect();
    // A first line that holds one number is a count of points.
    let data = if sizes.first() == Some(&1) { &lines[1..] } else { &lines[..] };
    let unorganised =
        |what: &str| Ok(Kind::Refused(format!("{what}, unorganised (no row and column)"), STRUCTURED));
    match sizes.as_slice() {
        [1, 1] | [1, 1, 3, ..] => Ok(Kind::Ptx),
        [1] if extension == "ptx" => Ok(Kind::Ptx),
        [_, ..] if !data.is_empty() && data.iter().all(|line| line.cell) => Ok(Kind::Xyz),
        [.., n] if extension == "pts" && *n >= 3 => unorganised("PTS point cloud"),
        [.., n] if *n >= 3 => unorganised("text point cloud"),
        _ => Ok(Kind::Refused("a file of unknown format".to_owned(), STRUCTURED)),
    }
}

/// A line of a text file.
struct Sampled {
    /// Numbers in it.
    numbers: usize,
    /// True when they can be row, column and a point.
    cell: bool,
}

/// The first lines that are no comments; nothing when one holds anything but numbers.
fn sample(head: &[u8]) -> Result<Vec<Sampled>> {
    // The last line is only whole when the file ends with it.
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
        let (fields, n) = text::fields(line);
        if fields.iter().take(n).any(|field| text::number(field).is_none()) {
            return Ok(Vec::new());
        }
        sampled.push(Sampled { numbers: n, cell: xyz::is_cell(line) });
    }
    Ok(sampled)
}
