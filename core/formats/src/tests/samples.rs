//! Every sample reads as what it is, or is refused with the right sentence.

use super::collect::{read, samples, unpacked};

#[track_caller]
fn check_refused(name: &str, sentence: &str) {
    let Some(folder) = samples() else { return };
    let error = read(&folder.join(name), None).err().unwrap_or_else(|| panic!("{name} was read"));
    let text = error.to_string();
    assert!(text.contains(sentence), "{name}: {text}");
    assert!(!text.contains('\n') && text.len() < 400, "{name}: {text}");
}

#[test]
fn what_is_no_structured_scan_is_refused_with_the_reason() {
    for (name, sentence) in [
        ("e57/cryinc_cartesian_invalid_state_single.e57", "3 points without row and column"),
        ("e57/cryinc_corrupt_crc.e57", "the checksum of page"),
        ("e57/cryinc_empty_pc.e57", "holds no points"),
        ("e57/cryinc_float_intensity_without_min_max.e57", "without row and column"),
        ("e57/cryinc_integer_intensity.e57", "without row and column"),
        ("e57/cryinc_no_ext_namespace.e57", "without row and column"),
        ("e57/cryinc_read_error.e57", "comes twice: rows and columns were lost"),
        ("e57/cryinc_scaled_integer_intensity.e57", "without row and column"),
        ("e57/cryinc_tiny_pc_with_extension.e57", "without row and column"),
        ("e57/cryinc_tiny_spherical.e57", "without row and column"),
        ("e57/libe57format_InvalidCVHeader.e57", "holds no points"),
        ("e57/libe57format_ZeroPoints.e57", "holds no points"),
        ("e57/libe57format_ZeroPointsInvalid.e57", "holds no points"),
        ("e57/libe57format_bad-crc.e57", "the checksum of page"),
        ("e57/unorganised_bunnyInt32.e57", "30571 points without row and column"),
        ("lattice/complex-transform.ptx", "too few to tell rows from columns"),
        ("lattice/amapvox_scan_test.ptx", "too few to tell rows from columns"),
        ("lattice/pumpA_lf.ptx.gz", "gzip archive: unpack it first"),
    ] {
        check_refused(name, sentence);
    }
}

/// Largest distance of a coordinate between two lattices, metres, and the number of common cells; every valid
/// cell of the second within its columns must be one of the first.
fn compare(a: &platen_scan::Lattice, b: &platen_scan::Lattice, column_offset: usize) -> (f64, usize) {
    let (mut worst, mut common) = (0.0_f64, 0);
    for column in 0..b.n_columns() {
        for row in 0..b.n_rows() {
            let (p, q) = (a.point(a.cell(column + column_offset, row)), b.point(b.cell(column, row)));
            assert_eq!(p.is_some(), q.is_some(), "cell ({row}, {column})");
            if let (Some(p), Some(q)) = (p, q) {
                common += 1;
                (0..3).for_each(|k| worst = worst.max((p[k] - q[k]).abs()));
            }
        }
    }
    (worst, common)
}

#[test]
fn the_pump_is_the_same_lattice_in_every_format() {
    let Some(folder) = samples() else { return };
    let temporary = tempfile::tempdir().unwrap();
    let pump =
        |name: &str| read(&unpacked(&folder.join("lattice").join(name), temporary.path()), None).unwrap();
    let e57 = pump("pumpA.e57");
    assert_eq!((e57.n_rows(), e57.n_columns(), e57.n_valid()), (1074, 345, 155_201));
    let notes = e57.header().notes.join("\n");
    assert!(
        notes.contains("at the bottom of the file (correlation of row with elevation +0.99999"),
        "{notes}"
    );
    assert!(
        notes.contains("columns run clockwise in the file (correlation of column with azimuth -0.9999"),
        "{notes}"
    );
    assert!(notes.contains("steps 0.0676 deg down a column and 0.2499 deg between columns"), "{notes}");

    let (worst, common) = compare(&e57, &pump("pumpA_lf.ptx.gz"), 0);
    assert!(worst < 5e-6 && common == 155_201, "{worst} m over {common} cells");

    // Five decimals: half of the last one.
    let (worst, common) = compare(&e57, &pump("pumpA_rowcol.xyz.gz"), 0);
    assert!(worst < 5e-6 + 1e-9 && common == 155_201, "{worst} m over {common} cells");

    let xyb = pump("pumpA.xyb.gz");
    let (worst, common) = compare(&e57, &xyb, 0);
    assert!(worst < 5e-6 && common == 155_201, "{worst} m over {common} cells");
    assert!(xyb.header().notes[1].contains("hits without row and column"), "{:?}", xyb.header().notes);

    // The first 40 columns of a file whose columns run clockwise are the last 40 by azimuth.
    let (worst, common) = compare(&e57, &pump("pumpA_crlf_head.ptx.gz"), 345 - 40);
    assert!(worst < 5e-6 && common == 3579, "{worst} m over {common} cells");
}

#[test]
fn the_plates_read_in_scanner_order() {
    let Some(folder) = samples() else { return };
    let temporary = tempfile::tempdir().unwrap();
    for (name, rows, columns, step_deg, first_azimuth_deg, top_deg) in [
        ("plates/p1_cylinder/scan.e57", 1081, 1092, 0.05, 25.765339195740378, 3.9867315251541027),
        ("plates/p5_cone_ptx/scan.ptx.gz", 878, 871, 0.06, 27.36282956830304, 3.9788196391352866),
    ] {
        let lattice = read(&unpacked(&folder.join(name), temporary.path()), None).unwrap();
        let header = lattice.header();
        assert_eq!((lattice.n_rows(), lattice.n_columns()), (rows, columns), "{name}");
        assert!((header.azimuth_step.to_degrees() - step_deg).abs() < 1e-4, "{name}: {header:?}");
        assert!((header.elevation_step.to_degrees() - step_deg).abs() < 1e-4, "{name}: {header:?}");
        // The generator's first column is the one farthest to the left: azimuth falls from there.
        let start_deg = first_azimuth_deg - step_deg * (columns - 1) as f64;
        assert!((header.azimuth_start.to_degrees() - start_deg).abs() < 1e-3, "{name}: {header:?}");
        assert!((header.elevation_start.to_degrees() - top_deg).abs() < 1e-3, "{name}: {header:?}");
        for column in [0, columns / 2, columns - 1] {
            let cells = (0..rows).map(|row| lattice.cell(column, row));
            let seen: Vec<f64> = cells.filter_map(|c| lattice.direction(c)).map(|d| d.elevation).collect();
            assert!(seen.windows(2).all(|pair| pair[1] < pair[0]), "{name}: column {column} goes down");
        }
    }
}
