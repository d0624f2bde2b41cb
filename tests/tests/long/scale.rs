//! Memory and its growth from a table scan to a full dome, with streamed columns.
//!
//! `PLATEN_DOME` adds the 44 million cells of a full dome, which take a minute to cast.

use serde_json::Value as Json;

/// Memory limit of the whole process: this many times the raw lattice, ...
const LATTICES: f64 = 3.0;
/// ... plus the memory that any measurement needs: program, libraries, mesh, factor. Megabytes.
const BASE_MB: f64 = 64.0;

fn number(row: &Json, name: &str) -> f64 {
    row[name].as_f64().unwrap_or_else(|| panic!("no {name} in {row}"))
}

#[test]
fn memory_is_bounded_by_the_lattice_and_for_a_dome_by_the_plate() {
    let folder = tempfile::tempdir().unwrap();
    let cells = if std::env::var_os("PLATEN_DOME").is_some() { "quarter,half,dome" } else { "quarter,half" };
    let output = platen_tests::program("platen")
        .args([
            "bench",
            "scale",
            "--json",
            "--threads",
            "2",
            "--flattening",
            "elastic",
            "--cells",
            cells,
            "--out",
        ])
        .arg(folder.path().join("bench"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Json = serde_json::from_slice(&output.stdout).unwrap();
    let rows = found["scale"].as_array().unwrap();
    println!("| lattice | cells | on the plate | columns ms | extract ms | measure ms | raw MB | peak MB |");
    for row in rows {
        let cells = number(row, "rows") * number(row, "columns");
        let [points, columns, extract, measure, raw, peak] =
            ["plate_points", "columns_ms", "extract_ms", "measure_ms", "raw_lattice_mb", "peak_mb"]
                .map(|name| number(row, name));
        println!(
            "| {} | {cells} | {points} | {columns:.0} | {extract:.0} | {measure:.0} | {raw:.0} | {peak:.0} |",
            row["lattice"]
        );
        assert!(peak < LATTICES * raw + BASE_MB, "{row}");
    }
    assert!(rows.len() >= 2);
    // Four times the cells give four times the samples on the plate: no samples are dropped.
    let growth = number(&rows[1], "plate_points") / number(&rows[0], "plate_points");
    assert!((growth - 4.0).abs() < 0.1, "{growth}");
    if let Some(dome) = rows.get(2) {
        // The same plate at the same step: its surroundings are not kept.
        assert!(number(dome, "peak_mb") < 0.5 * number(dome, "raw_lattice_mb"), "{dome}");
    }
}
