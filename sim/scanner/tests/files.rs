//! Tests that files of every format contain the scan.
#![expect(clippy::unwrap_used, reason = "a test that cannot read its file must fail")]

use e57::{CartesianCoordinate, E57Reader, SphericalCoordinate};
use platen_sim_plate::{Plate, PlateState, Vec3};
use platen_sim_scanner::{
    E57Encoding, FileFormat, FileOrder, Instrument, Scene, SimLattice, SimScan, SimState, Surroundings,
    scan_all,
};
use std::path::PathBuf;

fn scan() -> SimScan {
    let plate = Plate::new(&PlateState::flat(3000.0, 2500.0, 36.0)).unwrap();
    let lattice = SimLattice::around(&plate.corners(), 0.05, 0.01);
    let scene = Scene::new(Some(plate), &Surroundings::default());
    let instrument = Instrument { dropout: 0.05, ..Instrument::default() };
    SimScan { lattice, columns: scan_all(&scene, &lattice, &instrument, 1) }
}

fn written(scan: &SimScan, name: &str, format: FileFormat, order: FileOrder) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    scan.write(&path, format, order).unwrap();
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    (folder, path)
}

/// Returns the point that a file must contain at (row, column) in the default order.
fn point(scan: &SimScan, row: usize, column: usize) -> Option<Vec3> {
    let source = &scan.columns[scan.columns.len() - 1 - column];
    let (az, el) = (source.azimuth[row], source.elevation[row]);
    let direction = Vec3::new(el.cos() * az.cos(), el.cos() * az.sin(), el.sin());
    (source.state[row] == SimState::Valid).then(|| direction * f64::from(source.range_m[row]))
}

#[test]
fn e57_holds_every_cell_in_every_encoding() {
    let scan = scan();
    let encodings = [
        (E57Encoding::CartesianScaled, 1e-5),
        (E57Encoding::CartesianDouble, 1e-12),
        (E57Encoding::CartesianSingle, 1e-5),
        (E57Encoding::Spherical, 1e-12),
    ];
    for (encoding, quantum) in encodings {
        let (_folder, path) = written(&scan, "scan.e57", FileFormat::E57(encoding), FileOrder::default());
        let mut reader = E57Reader::from_file(path).unwrap();
        let cloud = reader.pointclouds().remove(0);
        let mut points = reader.pointcloud_simple(&cloud).unwrap();
        points.spherical_to_cartesian(true);
        points.normalize_intensity(false);
        let mut n = 0;
        for cell in points {
            let cell = cell.unwrap();
            let expected = point(&scan, cell.row as usize, cell.column as usize);
            let found = match cell.cartesian {
                CartesianCoordinate::Valid { x, y, z } => Some(Vec3::new(x, y, z)),
                _ => None,
            };
            match (expected, found) {
                (Some(a), Some(b)) => assert!((a - b).norm() < quantum),
                (None, None) => {}
                (a, b) => {
                    let direction_only = matches!(cell.spherical, SphericalCoordinate::Direction { .. });
                    assert!(a.is_none() && direction_only, "{encoding:?}: {a:?} {b:?}");
                }
            }
            n += 1;
        }
        assert_eq!(n, scan.lattice.n_cells());
    }
}

#[test]
fn ptx_holds_every_cell_in_order() {
    let scan = scan();
    for crlf in [false, true] {
        let (_folder, path) = written(&scan, "scan.ptx", FileFormat::Ptx { crlf }, FileOrder::default());
        let text = std::fs::read_to_string(path).unwrap();
        assert_eq!(text.contains('\r'), crlf);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 10 + scan.lattice.n_cells());
        assert_eq!(lines[..2], [scan.lattice.n_columns.to_string(), scan.lattice.n_rows.to_string()]);
        for (k, line) in lines[10..].iter().enumerate() {
            let fields: Vec<f64> = line.split(' ').map(|field| field.parse().unwrap()).collect();
            let (row, column) = (k % scan.lattice.n_rows as usize, k / scan.lattice.n_rows as usize);
            let found = Vec3::new(fields[0], fields[1], fields[2]);
            assert!((found - point(&scan, row, column).unwrap_or_default()).norm() < 1e-6);
        }
    }
}

#[test]
fn xyz_leaves_gaps_out_and_xyb_writes_zeros() {
    let scan = scan();
    let n_valid = scan.columns.iter().flat_map(|c| &c.state).filter(|s| **s == SimState::Valid).count();
    let (_folder, path) = written(&scan, "scan.xyz", FileFormat::Xyz, FileOrder::default());
    let text = std::fs::read_to_string(path).unwrap();
    assert_eq!(text.lines().count(), n_valid);
    let fields: Vec<f64> = text.lines().nth(100).unwrap().split(' ').map(|f| f.parse().unwrap()).collect();
    let expected = point(&scan, fields[0] as usize, fields[1] as usize).unwrap();
    assert!((Vec3::new(fields[2], fields[3], fields[4]) - expected).norm() < 1e-6);

    let (_folder, path) = written(&scan, "scan.xyb", FileFormat::Xyb, FileOrder::default());
    let bytes = std::fs::read(path).unwrap();
    let start = bytes.windows(4).position(|w| w == [0; 4]).unwrap() + 4;
    assert_eq!(bytes.len() - start, 26 * scan.lattice.n_cells());
    let x = f64::from_le_bytes(bytes[start..start + 8].try_into().unwrap());
    assert!((x - point(&scan, 0, 0).unwrap_or_default().x).abs() < 1e-12);
}

#[test]
fn orders_are_what_they_say() {
    let scan = scan();
    let first = |order| {
        let (_folder, path) = written(&scan, "scan.ptx", FileFormat::Ptx { crlf: false }, order);
        let text = std::fs::read_to_string(path).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        let point = |line: &str| {
            let fields: Vec<f64> = line.split(' ').map(|field| field.parse().unwrap()).collect();
            [fields[1].atan2(fields[0]), fields[2].atan2(fields[0].hypot(fields[1]))]
        };
        let valid: Vec<&&str> = lines[10..].iter().filter(|line| !line.starts_with("0 0 0")).collect();
        (lines[0].parse::<u32>().unwrap(), point(valid[0]), point(valid[valid.len() - 1]))
    };
    let usual = FileOrder::default();
    let (columns, [az_first, el_first], [az_last, el_last]) = first(usual);
    assert!(columns == scan.lattice.n_columns && az_first > az_last && el_first > el_last);
    let (_, [az_first, _], [az_last, _]) = first(FileOrder { counter_clockwise: true, ..usual });
    assert!(az_first < az_last);
    let (_, [_, el_first], [_, el_last]) = first(FileOrder { bottom_up: true, ..usual });
    assert!(el_first < el_last);
    assert_eq!(first(FileOrder { transposed: true, ..usual }).0, scan.lattice.n_rows);
}
