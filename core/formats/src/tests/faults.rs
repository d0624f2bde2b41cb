//! Faults of files by the names in `tests/README.md` that no other test covers.

use std::io::Write as _;

use platen_scan::{Direction, Lattice};

use super::collect::{self, read};
use super::write::*;
use crate::orient::{Expected, Mirror, Turn};
use crate::{ReadError, header_text};

/// Reads bytes under a name, with the declarations of the plant about the scanner.
fn read_with(bytes: &[u8], name: &str, known: Expected) -> Result<Lattice, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    collect::read_with(&path, None, &known)
}

#[track_caller]
fn refused(bytes: &[u8], name: &str, sentence: &str) {
    let error =
        read_with(bytes, name, Expected::default()).err().unwrap_or_else(|| panic!("{name} was read"));
    assert!(error.to_string().contains(sentence), "{error}");
}

/// Returns the lattice as XYZ, each point changed by `change`; `None` leaves a point out.
fn changed(change: impl Fn(u32, u32, [f64; 3]) -> Option<[f64; 3]>) -> Vec<u8> {
    let mut text = Vec::new();
    for column in 0..COLUMNS {
        for row in (0..ROWS).filter(|row| !missing(*row, column)) {
            if let Some([x, y, z]) = change(row, column, point(row, column)) {
                writeln!(text, "{row} {column} {x:.7} {y:.7} {z:.7}").unwrap();
            }
        }
    }
    text
}

#[test]
fn tail_zero_second_half_is_missing_and_said() {
    let text = String::from_utf8(ptx(PTX, COLUMNS)).unwrap();
    let half = 10 + (ROWS * COLUMNS / 2) as usize;
    let line = |(number, line): (usize, &str)| {
        if number < half { format!("{line}\n") } else { "0 0 0 0.5\n".to_owned() }
    };
    let file: String = text.lines().enumerate().map(line).collect();
    let lattice = read_with(file.as_bytes(), "scan.ptx", Expected::default()).unwrap();
    let notes = lattice.header().notes.join("\n");
    assert!(notes.contains("16 of 32 columns hold no measurement"), "{notes}");
    assert_eq!(lattice.n_columns(), COLUMNS as usize);
}

#[test]
fn split_files_of_one_scan_are_not_measured_as_one() {
    // Half of the columns form a sound lattice by themselves: only the second file shows the split, see the watched
    // folder.
    let half = changed(|_, column, xyz| (column < COLUMNS / 2).then_some(xyz));
    let lattice = read_with(&half, "scan_1.xyz", Expected::default()).unwrap();
    assert_eq!(lattice.n_columns(), COLUMNS as usize / 2);
}

#[test]
fn mirrored_is_refused_when_the_turn_is_known_and_mended_when_the_mirror_is() {
    let mirrored = changed(|_, _, [x, y, z]| Some([x, -y, z]));
    let known = Expected { turn: Some(Turn::CounterClockwise), ..Expected::default() };
    let error = read_with(&mirrored, "scan.xyz", known).unwrap_err().to_string();
    assert!(
        error.contains("columns run clockwise, this scanner's run counter-clockwise: the file is mirrored")
    );
    let mended = read_with(&mirrored, "scan.xyz", Expected { mirror: Mirror::Y, ..known }).unwrap();
    let found = mended.point(mended.cell(3, 5)).unwrap();
    assert!((0..3).all(|k| (found[k] - point(5, 3)[k]).abs() < 1e-6));
}

#[test]
fn units_raw_integers_taken_unscaled_are_neither_metres_nor_millimetres() {
    refused(&changed(|_, _, xyz| Some(xyz.map(|c| (c / 1e-5).round()))), "scan.xyz", "export in metres");
}

#[test]
fn pose_twice_and_big_coordinates_are_not_seen_from_the_scanner() {
    let national = changed(|_, _, [x, y, z]| Some([x + 512_345.25, y + 5_403_210.5, z + 250.0]));
    let moved = changed(|_, _, [x, y, z]| Some([x + 6.0, y + 1.0, z + 0.5]));
    for file in [national, moved] {
        refused(&file, "scan.xyz", "the points are not seen from the origin of the file");
    }
}

#[test]
fn intensity_min_equals_max_is_said() {
    let text = String::from_utf8(changed(|_, _, xyz| Some(xyz))).unwrap();
    let flat: String = text.lines().map(|line| format!("{line} 17\n")).collect();
    let lattice = read_with(flat.as_bytes(), "scan.xyz", Expected::default()).unwrap();
    let notes = lattice.header().notes.join("\n");
    assert!(notes.contains("all intensities are 17"), "{notes}");
}

#[test]
fn two_face_overlap_is_said() {
    let step = std::f64::consts::TAU / 60.0;
    let mut text = Vec::new();
    for column in 0..70_u32 {
        for row in 0..10_u32 {
            let azimuth = step * f64::from(column);
            let direction = Direction { azimuth, elevation: 0.3 - 0.05 * f64::from(row) };
            let [x, y, z] = direction.unit().map(|c| c * 5.0);
            writeln!(text, "{row} {column} {x:.7} {y:.7} {z:.7}").unwrap();
        }
    }
    let lattice = read_with(&text, "scan.xyz", Expected::default()).unwrap();
    let notes = lattice.header().notes.join("\n");
    assert!(
        notes.contains("70 columns cover more than a full circle: the overlap was measured twice"),
        "{notes}"
    );
}

#[test]
fn duplicate_cell_is_refused_with_its_place() {
    let mut file = changed(|_, _, xyz| Some(xyz));
    file.extend(b"2 3 1.0 2.0 3.0\n");
    refused(&file, "scan.xyz", "cell (row 2, column 3) comes twice");
}

/// A file whose description claims a scan written by this program, but whose cells contradict it, is read by its cells.
#[test]
fn a_header_that_does_not_fit_its_cells_is_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.e57");
    std::fs::write(&path, e57(PLAIN, 1)).unwrap();
    let found = read(&path, None).unwrap().header().clone();
    for (name, wrong) in [
        ("rows", platen_scan::ScanHeader { n_rows: ROWS - 1, ..found.clone() }),
        ("size", platen_scan::ScanHeader { n_columns: 131_072, n_rows: 65_536, ..found.clone() }),
        ("start", platen_scan::ScanHeader { azimuth_start: 1.0, ..found.clone() }),
        ("step", platen_scan::ScanHeader { elevation_step: f64::NAN, ..found.clone() }),
    ] {
        std::fs::write(&path, described(PLAIN, &header_text::to_text(&wrong, 3))).unwrap();
        assert_eq!(read(&path, None).unwrap().header(), &found, "{name}");
    }
    let own =
        platen_scan::ScanHeader { n_columns: COLUMNS + 2, notes: vec!["as it was".to_owned()], ..found };
    std::fs::write(&path, described(PLAIN, &header_text::to_text(&own, 3))).unwrap();
    let lattice = read(&path, None).unwrap();
    let mut header = lattice.header().clone();
    assert!(header.notes.remove(0).starts_with("read from E57"));
    assert_eq!(header, own);
    assert_eq!(lattice.point(lattice.cell(3, 5)).map(|p| (p[0] - point(5, 3)[0]).abs() < 1e-6), Some(true));
}

/// Found by fuzzing: nearly equal elevations would have required more rows than there is memory.
#[test]
fn steps_of_no_scanner_are_refused_before_memory_runs_out() {
    let mut file = b"# SCENE XYZ binary format v1.0\nRows 0\nCols 0\n\0\0\0\0".to_vec();
    for z in [0.0, 1e-300, 2e-300, 3e-300, 1e-300, 2e-300, 3e-300, 5.0] {
        [1.0, 0.0, z].iter().for_each(|c: &f64| file.extend(c.to_le_bytes()));
        file.extend([0, 0]);
    }
    refused(&file, "scan.xyb", "no scanner has so many rows");
}
