//! Small lattice in every encoding: it is read back, or refused with the right message.

use std::io::Cursor;
use std::path::Path;

use platen_scan::Lattice;

use super::collect::read;
use super::write::*;
use crate::{Format, ReadError, ScanReader};

/// Reads bytes as a file of this name.
fn read_bytes(bytes: &[u8], name: &str, chosen: Option<usize>) -> Result<Lattice, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path, chosen)
}

#[track_caller]
fn check(bytes: &[u8], name: &str, quantum: f64) -> Lattice {
    let lattice = read_bytes(bytes, name, None).unwrap_or_else(|e| panic!("{name}: {e}"));
    check_lattice(&lattice, quantum);
    lattice
}

#[track_caller]
fn check_lattice(lattice: &Lattice, quantum: f64) {
    assert_eq!((lattice.n_rows(), lattice.n_columns()), (ROWS as usize, COLUMNS as usize));
    for column in 0..COLUMNS {
        for row in 0..ROWS {
            let found = lattice.point(lattice.cell(column as usize, row as usize));
            assert_eq!(found.is_none(), missing(row, column), "({row}, {column})");
            let Some(found) = found else { continue };
            let truth = point(row, column);
            for k in 0..3 {
                assert!((found[k] - truth[k]).abs() < quantum, "({row}, {column}): {found:?}, {truth:?}");
            }
        }
    }
}

#[track_caller]
fn check_refused(bytes: &[u8], name: &str, sentence: &str) {
    let error = read_bytes(bytes, name, None).err().unwrap_or_else(|| panic!("{name} was read"));
    assert!(error.to_string().contains(sentence), "{name}: {error}");
    assert!(!error.to_string().contains('\n'), "{name}: {error}");
}

fn notes(lattice: &Lattice) -> String {
    lattice.header().notes.join("\n")
}

/// A micrometre.
const EXACT: f64 = 1e-6;

#[test]
fn every_encoding_of_an_e57_gives_the_same_cells() {
    for spherical in [false, true] {
        for (coordinates, quantum) in
            [(double as fn(_) -> _, EXACT), (single as fn(_) -> _, 2e-6), (scaled as fn(_) -> _, 8e-5)]
        {
            for gaps in [Gaps::Flagged, Gaps::LeftOut, Gaps::Zero] {
                let style = E57Style { spherical, coordinates, gaps, ..PLAIN };
                let lattice = check(&e57(style, 1), "scan.e57", quantum);
                let kind = if spherical { "spherical" } else { "Cartesian" };
                let said = &lattice.header().notes[0];
                assert!(said.starts_with(&format!("read from E57: {kind} coordinates, ")), "{said}");
            }
        }
    }
    check(&e57(E57Style { gaps: Gaps::Nan, ..PLAIN }, 1), "scan.e57", EXACT);
}

#[test]
fn azimuths_a_turn_off_are_the_same_directions() {
    for azimuth_turns in [-1.0, 1.0] {
        check(&e57(E57Style { spherical: true, azimuth_turns, ..PLAIN }, 1), "scan.e57", EXACT);
    }
}

#[test]
fn of_several_echoes_the_first_is_read() {
    for spherical in [false, true] {
        let lattice = check(&e57(E57Style { spherical, echoes: true, ..PLAIN }, 1), "scan.e57", EXACT);
        assert!(notes(&lattice).contains("the first of each is used"), "{}", notes(&lattice));
    }
}

#[test]
fn a_pose_is_reported_and_not_applied() {
    let lattice = check(&e57(E57Style { posed: true, ..PLAIN }, 1), "scan.e57", EXACT);
    assert!(notes(&lattice).contains("at 100 -20 3 m) is not applied"), "{}", notes(&lattice));
}

#[test]
fn indices_that_begin_anywhere_count_from_there() {
    let lattice = check(&e57(E57Style { offset: 7000, ..PLAIN }, 1), "scan.e57", EXACT);
    assert!(notes(&lattice).contains("begin at 7000 and 7000"), "{}", notes(&lattice));
}

#[test]
fn millimetres_are_converted_and_said() {
    for spherical in [false, true] {
        let lattice = check(&e57(E57Style { spherical, scale: 1000.0, ..PLAIN }, 1), "scan.e57", EXACT);
        assert!(notes(&lattice).contains("in millimetres"), "{}", notes(&lattice));
    }
}

#[test]
fn one_of_several_scans_must_be_chosen() {
    let two = e57(PLAIN, 2);
    check_refused(&two, "scan.e57", "holds 2 scans (1: 768 points without name, 2: 768 points without name)");
    check_lattice(&read_bytes(&two, "scan.e57", Some(2)).unwrap(), EXACT);
    assert!(matches!(read_bytes(&two, "scan.e57", Some(3)), Err(ReadError::NoSuchCloud(_, 2, _))));

    let several = [ptx(PTX, COLUMNS), ptx(PtxStyle { colour: true, ..PTX }, 20), b"\n".to_vec()].concat();
    check_refused(&several, "scan.ptx", "holds 2 scans (24 x 32 cells, 24 x 20 cells)");
    check_lattice(&read_bytes(&several, "scan.ptx", Some(1)).unwrap(), EXACT);
    assert_eq!(read_bytes(&several, "scan.ptx", Some(2)).unwrap().n_columns(), 20);
}

#[test]
fn every_ptx_gives_the_same_cells() {
    for bits in 0..32_u32 {
        let bit = |k: u32| bits >> k & 1 == 1;
        let style = PtxStyle {
            header_end: if bit(0) { "\r\n" } else { "\n" },
            cell_end: if bit(1) { "\r\n" } else { " \n" },
            bottom_up: bit(2),
            clockwise: bit(3),
            colour: bit(4),
            ..PTX
        };
        check(&ptx(style, COLUMNS), "scan.ptx", EXACT);
    }
    check(&ptx(PtxStyle { mark: "\u{feff}", ..PTX }, COLUMNS), "scan", EXACT);
    let comma = String::from_utf8(ptx(PTX, COLUMNS)).unwrap().replace('.', ",");
    check(comma.as_bytes(), "scan.ptx", EXACT);
}

#[test]
fn a_left_handed_ptx_is_mirrored_back() {
    let lattice = check(&ptx(PtxStyle { left_handed: true, ..PTX }, COLUMNS), "scan.ptx", EXACT);
    assert!(notes(&lattice).contains("left-handed: y mirrored"), "{}", notes(&lattice));
}

#[test]
fn a_ptx_without_a_pose_is_read() {
    let text = String::from_utf8(ptx(PTX, COLUMNS)).unwrap();
    let degenerate = text.replacen("1 0 0\n0 1 0\n0 0 1\n", "0 0 0\n0 0 0\n0 0 0\n", 1);
    check(degenerate.as_bytes(), "scan.ptx", EXACT);
    let scaled = text.replacen("1 0 0 0\n", "7 0 0 0\n", 1);
    let lattice = check(scaled.as_bytes(), "scan.ptx", EXACT);
    assert!(notes(&lattice).contains("not a rigid motion"), "{}", notes(&lattice));
}

#[test]
fn every_xyz_gives_the_same_cells() {
    let count = (0..ROWS * COLUMNS).filter(|i| !missing(i / COLUMNS, i % COLUMNS)).count();
    for (head, tail) in [
        (String::new(), ""),
        ("# exported\n\n".to_owned(), " 17"),
        (format!("{count}\n"), " 1 2 3"),
        ("\u{feff}// x\n".to_owned(), " 1 2 3 99 "),
    ] {
        for swapped in [false, true] {
            for end in ["\n", "\r\n"] {
                check(&xyz(&head, tail, swapped, end), "scan.xyz", EXACT);
            }
        }
    }
}

#[test]
fn every_xyb_gives_the_same_cells() {
    for along_rows in [false, true] {
        for sizes in [(ROWS, COLUMNS), (COLUMNS, ROWS)] {
            for missing_as in [0.0, f64::NAN] {
                check(&xyb(sizes, true, along_rows, missing_as), "scan.xyb", EXACT);
            }
        }
    }
    for sizes in [(ROWS, COLUMNS), (COLUMNS, ROWS), (0, 0)] {
        let lattice = check(&xyb(sizes, false, false, 0.0), "scan.xyb", EXACT);
        assert!(notes(&lattice).contains("placed by the order of their angles"), "{}", notes(&lattice));
    }
    check_refused(&xyb((0, 0), false, true, 0.0), "scan.xyb", "do not follow each other along columns");
}

#[test]
fn a_cut_xyb_says_so() {
    let whole = xyb((ROWS, COLUMNS), true, false, 0.0);
    check_refused(&whole[..whole.len() - 3], "scan.xyb", "19965 bytes of points, a multiple of 26 needed");
    check_refused(&whole[..60], "scan.xyb", "no end of the header in 60 bytes");
    let nameless = String::from_utf8_lossy(&whole[..80]).replace("Rows", "Raws").into_bytes();
    check_refused(&[&nameless[..], &[0; 30]].concat(), "scan.xyb", "does not contain Rows");
}

#[test]
fn a_cut_text_file_is_incomplete() {
    let whole = ptx(PTX, COLUMNS);
    let text = String::from_utf8(whole.clone()).unwrap();
    for lines in [0, 1, 2, 5, 9, 10, 11, 400, 777] {
        let cut: String = text.lines().take(lines).map(|line| format!("{line}\n")).collect();
        let error = read_bytes(cut.as_bytes(), "scan.ptx", None).unwrap_err();
        assert!(matches!(error, ReadError::Incomplete(..)), "{lines} lines: {error}");
        assert!(error.is_transient());
    }
    check_refused(
        text.lines().take(700).collect::<Vec<_>>().join("\n").as_bytes(),
        "scan.ptx",
        "PTX file is incomplete: 778 lines needed, found 700",
    );
    let whole = xyz("", " 17", false, "\n");
    check_refused(&whole[..whole.len() - 2], "scan.xyz", "ends in the middle of a line");
    check_refused(&xyz("999\n", " 17", false, "\n"), "scan.xyz", "698 points, 999 announced");
}

#[test]
fn a_cut_or_grown_e57_says_so() {
    let whole = e57(PLAIN, 1);
    check_refused(&whole[..whole.len() - 1024], "scan.e57", "23552 bytes, 24576 announced");
    check_refused(&whole[..whole.len() / 2], "scan.e57", "announced");
    check_refused(&whole[..500], "scan.e57", "500 bytes, at least 1024 needed");
    check_refused(&[&whole[..], &[0; 1024]].concat(), "scan.e57", "announced");
    // Preallocated by the share: the full size, with zeros after the bytes that have arrived.
    let mut preallocated = whole.clone();
    preallocated[3000..].fill(0);
    check_refused(&preallocated, "scan.e57", "checksum");
}

#[test]
fn a_length_off_by_one_in_the_header_is_harmless() {
    for off in [-1_i64, 1] {
        let mut file = e57(PLAIN, 1);
        let length = (file.len() as i64 + off) as u64;
        file[16..24].copy_from_slice(&length.to_le_bytes());
        let crc = crc32c(&file[..1020]);
        file[1020..1024].copy_from_slice(&crc.to_be_bytes());
        let lattice = check(&file, "scan.e57", EXACT);
        assert!(notes(&lattice).contains("the header announces"), "{}", notes(&lattice));
    }
}

/// Computes the CRC-32C bit by bit from its polynomial.
pub(super) fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ (0x82F6_3B78 & (crc & 1).wrapping_neg()))
    })
}

/// Replaces every occurrence of a text by one of equal length, and corrects the checksums.
fn edited(file: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut logical: Vec<u8> = file.chunks(1024).flat_map(|page| &page[..1020]).copied().collect();
    let found: Vec<usize> =
        (0..logical.len() - from.len()).filter(|at| logical[*at..].starts_with(from.as_bytes())).collect();
    assert!(!found.is_empty(), "{from} is not there");
    found.iter().for_each(|at| logical[*at..at + to.len()].copy_from_slice(to.as_bytes()));
    logical.chunks(1020).flat_map(|page| [page, &crc32c(page).to_be_bytes()].concat()).collect()
}

#[test]
fn an_index_beyond_the_declared_bounds_is_an_error() {
    let lies =
        edited(&e57(PLAIN, 1), "type=\"Integer\">31</columnMaximum>", "type=\"Integer\">17</columnMaximum>");
    check_refused(&lies, "scan.e57", "point 432: column 18 lies outside of the declared 0 to 17");
}

/// Found by fuzzing: the XML parser quotes a line break in the file.
#[test]
fn broken_xml_is_reported_in_one_line() {
    let broken = edited(&e57(PLAIN, 1), "\"Structure\">\n", "\"Structure\"/\n");
    check_refused(&broken, "scan.e57", "Failed to parse XML data");
}

#[test]
fn a_prototype_of_no_bits_is_refused_before_memory_runs_out() {
    let edits = [
        ("minimum=\"-2000000\"", "minimum=\"02000000\""),
        ("maximum=\"16383\"", "maximum=\"00000\""),
        ("maximum=\"2047\"", "maximum=\"0000\""),
        ("maximum=\"2\"", "maximum=\"0\""),
    ];
    let file = e57(E57Style { coordinates: scaled, ..PLAIN }, 1);
    let file = edits.iter().fold(file, |file, (from, to)| edited(&file, from, to));
    let refused = ScanReader::new(Cursor::new(file), Format::E57, None).err().expect("refused");
    assert!(refused.to_string().contains("no field of a point takes any space"), "{refused}");
}

#[test]
fn formats_that_hold_no_lattice_are_named() {
    for (name, bytes, sentence) in [
        ("a.fls", &b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1 rest"[..], "FARO .fls scan (compound file): export"),
        ("b.bin", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1 rest", "FARO .fls scan (compound file)"),
        ("c.las", b"LASF....", "LAS or LAZ point cloud, unorganised: export"),
        ("d.fws", b"anything", "SCENE workspace"),
        ("e.lsproj", b"anything", "SCENE project"),
        ("f.pts", b"2\n1.5 2 3 -100 1 2 3\n1.5 2 3 4 5 6 7\n", "PTS point cloud, unorganised"),
        ("g.xyz", b"1.5 2.5 3.5\n1.5 2.5 3.5\n", "text point cloud, unorganised"),
        ("h.pod", b"\x01\x02\x03", "POD point cloud"),
        ("i.cpe", b"\x01\x02\x03", "FARO .cpe"),
        ("j.dat", b"\x01\x02\x00\x03", "a file of unknown format"),
        ("k.txt", b"Dear colleague,\nhere is the scan.\n", "a file of unknown format"),
        ("l.e57", b"", "scan file is incomplete: 0 bytes"),
    ] {
        check_refused(bytes, name, sentence);
    }
    let folder = tempfile::tempdir().unwrap();
    let scan = folder.path().join("Scan_001.fls");
    std::fs::create_dir(&scan).unwrap();
    let refused = read(&scan, None).unwrap_err().to_string();
    assert!(refused.contains("FARO scan as a folder") && refused.contains("structured E57"), "{refused}");
    assert!(matches!(read(Path::new("/nowhere/scan.e57"), None), Err(ReadError::Io { .. })));
}
