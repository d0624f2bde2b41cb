//! Sample files: each is read correctly, or refused with the right message.

use platen_tests::samples;
use serde_json::Value as Json;

use super::collect::read;

#[track_caller]
fn check_refused(name: &str, sentence: &str) {
    for file in samples::each(name) {
        let error = read(&file, None).err().unwrap_or_else(|| panic!("{} was read", file.display()));
        let text = error.to_string();
        assert!(text.contains(sentence), "{name}: {text}");
        assert!(!text.contains('\n') && text.len() < 400, "{name}: {text}");
    }
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

/// Returns the largest distance of a coordinate between two lattices, metres, and the number of common cells; every
/// valid cell of the second within its columns must be one of the first.
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
    for set in samples::each("lattice") {
        let whole = set.join("pumpA.e57").metadata().unwrap().len() > 1_000_000;
        let (n_rows, n_columns, n_valid) = if whole { (1074, 345, 155_201) } else { (455, 60, 9908) };
        // The E57 of the small set contains f32.
        let most = if whole { 5e-6 } else { 5e-6 + 3e-7 };
        let temporary = tempfile::tempdir().unwrap();
        let pump = |name: &str| read(&samples::unpacked(&set.join(name), temporary.path()), None).unwrap();
        let e57 = pump("pumpA.e57");
        assert_eq!((e57.n_rows(), e57.n_columns(), e57.n_valid()), (n_rows, n_columns, n_valid));
        let notes = e57.header().notes.join("\n");
        let correlation = if whole { "+0.99999" } else { "+1.00000" };
        let rows = format!("at the bottom of the file (correlation of row with elevation {correlation}");
        assert!(notes.contains(&rows), "{notes}");
        assert!(
            notes.contains("columns run clockwise in the file (correlation of column with azimuth -0.9999"),
            "{notes}"
        );
        let step_deg = if whole { 0.2499 } else { 0.2508 };
        let steps = format!("steps 0.0676 deg down a column and {step_deg} deg between columns");
        assert!(notes.contains(&steps), "{notes}");

        let (worst, common) = compare(&e57, &pump("pumpA_lf.ptx.gz"), 0);
        assert!(worst < most && common == n_valid, "{worst} m over {common} cells");

        // Five decimals: the error is half of the last one.
        let (worst, common) = compare(&e57, &pump("pumpA_rowcol.xyz.gz"), 0);
        assert!(worst < most + 1e-9 && common == n_valid, "{worst} m over {common} cells");

        let xyb = pump("pumpA.xyb.gz");
        let (worst, common) = compare(&e57, &xyb, 0);
        assert!(worst < most && common == n_valid, "{worst} m over {common} cells");
        assert!(xyb.header().notes[1].contains("hits without row and column"), "{:?}", xyb.header().notes);

        // The first 40 columns of a file whose columns run clockwise are the last 40 by azimuth.
        let (worst, common) = compare(&e57, &pump("pumpA_crlf_head.ptx.gz"), n_columns - 40);
        assert!(worst < most && common == 3579, "{worst} m over {common} cells");
    }
}

#[test]
fn the_plates_read_in_scanner_order() {
    let temporary = tempfile::tempdir().unwrap();
    for file in ["p1_cylinder/scan.e57", "p5_cone_ptx/scan.ptx.gz"]
        .into_iter()
        .flat_map(|name| samples::each(&format!("plates/{name}")))
    {
        let name = file.display();
        let truth = std::fs::read(file.with_file_name("truth.json")).unwrap();
        let truth: Json = serde_json::from_slice(&truth).unwrap();
        let number = |name: &str| truth["lattice"][name].as_f64().unwrap();
        let (rows, columns) = (number("nrow") as usize, number("ncol") as usize);
        let step_deg = number("step_deg");
        let lattice = read(&samples::unpacked(&file, temporary.path()), None).unwrap();
        let header = lattice.header();
        assert_eq!((lattice.n_rows(), lattice.n_columns()), (rows, columns), "{name}");
        assert!((header.azimuth_step.to_degrees() - step_deg).abs() < 1e-4, "{name}: {header:?}");
        assert!((header.elevation_step.to_degrees() - step_deg).abs() < 1e-4, "{name}: {header:?}");
        // The generator's first column is the one farthest to the left: azimuth falls from there.
        let start_deg = number("az_first_deg") - step_deg * (columns - 1) as f64;
        assert!((header.azimuth_start.to_degrees() - start_deg).abs() < 1e-3, "{name}: {header:?}");
        let top_deg = number("el_first_deg");
        assert!((header.elevation_start.to_degrees() - top_deg).abs() < 1e-3, "{name}: {header:?}");
        for column in [0, columns / 2, columns - 1] {
            let cells = (0..rows).map(|row| lattice.cell(column, row));
            let seen: Vec<f64> = cells.filter_map(|c| lattice.direction(c)).map(|d| d.elevation).collect();
            assert!(seen.windows(2).all(|pair| pair[1] < pair[0]), "{name}: column {column} goes down");
        }
    }
}
