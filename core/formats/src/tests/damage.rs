//! Damaged files: the result is an error or cells, never a panic or unbounded memory.

use std::io::Cursor;

use proptest::prelude::*;

use super::collect::collect;
use super::write::*;
use crate::orient::Expected;
use crate::read::format;
use crate::{ReadError, ScanReader};

/// Reads bytes in the format detected from them; `Ok` with the number of points delivered.
fn read(bytes: &[u8]) -> Result<u64, ReadError> {
    let format = format(&bytes[..bytes.len().min(1 << 14)], "")?;
    let reader = ScanReader::new(Cursor::new(bytes), format, None)?;
    Ok(collect(reader, &Expected::default())?.n_valid() as u64)
}

fn files() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("e57", e57(PLAIN, 1)),
        ("e57 spherical", e57(E57Style { spherical: true, gaps: Gaps::LeftOut, ..PLAIN }, 1)),
        ("ptx", ptx(PTX, COLUMNS)),
        ("xyz", xyz("", " 12", false, "\n")),
        ("xyb", xyb((ROWS, COLUMNS), true, false, 0.0)),
        ("xyb of hits", xyb((0, 0), false, false, 0.0)),
    ]
}

/// Largest number of cells in any of the files.
const ALL: u64 = (ROWS * COLUMNS) as u64;

#[test]
fn a_file_cut_anywhere_is_refused() {
    for (name, file) in files() {
        for length in (0..file.len()).step_by(97) {
            let cut = &file[..length];
            let read = read(cut);
            // A file cut after a whole point cannot be distinguished from a smaller scan unless it states the number.
            let whole_points = match name {
                "xyz" => cut.ends_with(b"\n"),
                "xyb" | "xyb of hits" => true,
                _ => false,
            };
            assert!(read.is_err() || whole_points, "{name} cut at {length} gave {read:?}");
        }
    }
}

#[test]
fn every_flipped_bit_of_an_e57_is_found() {
    let file = e57(PLAIN, 1);
    for bit in (0..file.len() * 8).step_by(61) {
        let mut damaged = file.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(read(&damaged).is_err(), "bit {bit}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Bytes replaced anywhere, with the checksums of an E57 corrected so that the damage reaches the parser.
    #[test]
    fn no_damage_brings_the_reader_down(
        which in 0_usize..6,
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
    ) {
        let (name, mut file) = files().swap_remove(which);
        for (place, byte) in edits {
            let at = place.index(file.len());
            file[at] = byte;
        }
        if name.starts_with("e57") {
            mend(&mut file);
        }
        if let Ok(points) = read(&file) {
            prop_assert!(points <= ALL);
        }
    }

    /// Arbitrary bytes.
    #[test]
    fn no_bytes_bring_the_reader_down(mut bytes in prop::collection::vec(any::<u8>(), 0..3000), head in 0..5) {
        let head: &[u8] = [b"ASTM-E57".as_slice(), b"5\n4\n0 0 0\n", b"1 2 3 4 5\n", b"# SCENE XYZ binary", b""][head as usize];
        bytes.splice(0..0, head.iter().copied());
        let _ = read(&bytes);
    }
}

/// Corrects the checksum of every page.
fn mend(file: &mut [u8]) {
    for page in file.chunks_exact_mut(1024) {
        let crc = super::formats::crc32c(&page[..1020]);
        page[1020..].copy_from_slice(&crc.to_be_bytes());
    }
}
