//! Sample scans of other writers: the small set in `tests/data`, always present, and the large one if it is present.
//!
//! Both have the same layout: `plates/NAME/{scan.e57 or scan.ptx.gz, job.json, truth.json}`, `lattice/*`, `e57/*`. The
//! plates of the small set are stored as ranges (`tests/data/README.md`) and unpacked once per build.

#![expect(clippy::panic, reason = "tests fail by panicking")]

use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use e57::{E57Writer, IndexBounds, Record, RecordDataType, RecordName, RecordValue};
use flate2::read::GzDecoder;
use serde_json::Value as Json;

use crate::repository;

/// Files of the large set that are not in the small one: one for its licence, one for its size.
const LARGE_ONLY: [&str; 2] = ["lattice/amapvox_scan_test.ptx", "e57/unorganised_bunnyInt32.e57"];

/// Returns the folders of samples: the small set, then the large one from `PLATEN_SAMPLES`, else `../shared/samples`.
///
/// The large set may be missing unless `PLATEN_SAMPLES` or `PLATEN_SAMPLES_REQUIRED` is set.
///
/// # Panics
/// If the small set cannot be unpacked, or the large one is required and missing.
pub fn sets() -> Vec<PathBuf> {
    let named = std::env::var_os("PLATEN_SAMPLES");
    let required = named.is_some() || std::env::var_os("PLATEN_SAMPLES_REQUIRED").is_some();
    let large = named.map_or_else(|| repository().join("../shared/samples"), PathBuf::from);
    assert!(large.is_dir() || !required, "no samples at {}: set PLATEN_SAMPLES", large.display());
    let mut sets = vec![small()];
    if large.is_dir() {
        sets.push(large);
    }
    sets
}

/// Returns one file or folder of each set.
///
/// # Panics
/// If a set does not have it.
pub fn each(name: &str) -> Vec<PathBuf> {
    let mut sets = sets();
    if LARGE_ONLY.contains(&name) {
        sets.remove(0);
    }
    let found: Vec<PathBuf> = sets.into_iter().map(|set| set.join(name)).collect();
    found.iter().for_each(|path| assert!(path.exists(), "no sample {}", path.display()));
    found
}

/// Returns the sample plates of every set, in order.
///
/// # Panics
/// If a set has none.
pub fn plates() -> Vec<PathBuf> {
    let list = |set: PathBuf| {
        let entries = std::fs::read_dir(set.join("plates")).into_iter().flatten().flatten();
        let mut folders: Vec<PathBuf> = entries.map(|e| e.path()).filter(|path| path.is_dir()).collect();
        assert!(!folders.is_empty(), "no sample plates in {}", set.display());
        folders.sort();
        folders
    };
    sets().into_iter().flat_map(list).collect()
}

/// Returns a file unchanged, or unpacked into `folder` if it is packed.
///
/// # Panics
/// If it cannot be read.
pub fn unpacked(file: &Path, folder: &Path) -> PathBuf {
    if file.extension().is_none_or(|extension| extension != "gz") {
        return file.to_owned();
    }
    let target = folder.join(file.file_stem().unwrap_or_default());
    std::fs::write(&target, unzip(file)).unwrap_or_else(|e| panic!("{}: {e}", target.display()));
    target
}

/// Returns the scan of a sample plate, unpacked into `folder` if it is packed.
pub fn scan(plate: &Path, folder: &Path) -> PathBuf {
    let e57 = plate.join("scan.e57");
    if e57.exists() { e57 } else { unpacked(&plate.join("scan.ptx.gz"), folder) }
}

fn unzip(file: &Path) -> Vec<u8> {
    let read = || {
        let mut content = Vec::new();
        GzDecoder::new(std::fs::File::open(file)?).read_to_end(&mut content)?;
        io::Result::Ok(content)
    };
    read().unwrap_or_else(|e| panic!("{}: {e}", file.display()))
}

/// Returns the small set, unpacked beside the programs of this build under a name that depends on its content.
fn small() -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let unpack = || {
        let data = repository().join("tests/data");
        let mut files = Vec::new();
        list(&data, &mut files)?;
        let mut digest = 0xcbf2_9ce4_8422_2325_u64;
        for file in &files {
            for byte in std::fs::read(file)? {
                digest = (digest ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
        }
        let test = std::env::current_exe()?;
        let build = test.ancestors().nth(2).unwrap_or(Path::new(""));
        let target = build.join(format!("samples-{digest:016x}"));
        if target.is_dir() {
            return Ok(target);
        }
        // Test programs may unpack at the same time: each has its own folder, and the first rename wins.
        let own = build.join(format!("samples-{digest:016x}.{}", std::process::id()));
        for file in files {
            let place = own.join(file.strip_prefix(&data).unwrap_or(&file));
            let folder = place.parent().unwrap_or(&own);
            std::fs::create_dir_all(folder)?;
            match place.file_name().and_then(|name| name.to_str()) {
                Some("ranges.gz") => {}
                Some("truth.json.gz") => {
                    let truth = unzip(&file);
                    std::fs::write(folder.join("truth.json"), &truth)?;
                    write_scan(folder, &serde_json::from_slice(&truth)?, &file.with_file_name("ranges.gz"))?;
                }
                _ => {
                    std::fs::copy(&file, &place)?;
                }
            }
        }
        if std::fs::rename(&own, &target).is_err() {
            std::fs::remove_dir_all(&own)?;
        }
        io::Result::Ok(target)
    };
    FOLDER.get_or_init(|| unpack().unwrap_or_else(|e| panic!("tests/data: {e}"))).clone()
}

fn list(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    let mut entries = std::fs::read_dir(folder)?.collect::<io::Result<Vec<_>>>()?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        if entry.file_type()?.is_dir() {
            list(&entry.path(), files)?;
        } else {
            files.push(entry.path());
        }
    }
    Ok(())
}

/// Metres in one step of the stored ranges.
const QUANTUM: f64 = 5e-5;
/// Metres in one step of coordinates, as in the large set.
const SCALE: f64 = 1e-5;

/// Writes the ranges of a plate as the file that the large set has: E57, or packed PTX.
fn write_scan(folder: &Path, truth: &Json, ranges: &Path) -> io::Result<()> {
    let number = |name: &str| truth["lattice"][name].as_f64().unwrap_or(f64::NAN);
    let (n_columns, n_rows) = (number("ncol") as usize, number("nrow") as usize);
    let planes = unzip(ranges);
    let n = n_columns * n_rows;
    assert_eq!(planes.len(), 3 * n, "{}", ranges.display());
    let mut steps = vec![0_i64; n];
    let mut points = Vec::with_capacity(n);
    for cell in 0..n {
        let (column, row) = (cell / n_rows, cell % n_rows);
        let at = |columns: usize, rows: usize| match (column.checked_sub(columns), row.checked_sub(rows)) {
            (Some(column), Some(row)) => steps[column * n_rows + row],
            _ => 0,
        };
        let zigzag = [0, 1, 2].map(|k| i64::from(planes[k * n + cell]) << (8 * k)).iter().sum::<i64>();
        steps[cell] = at(1, 0) + at(0, 1) - at(1, 1) + ((zigzag >> 1) ^ -(zigzag & 1));
        let azimuth = (number("az_first_deg") - number("step_deg") * column as f64).to_radians();
        let elevation = (number("el_first_deg") - number("step_deg") * row as f64).to_radians();
        let range = steps[cell] as f64 * QUANTUM;
        let level = range * elevation.cos();
        let xyz = [level * azimuth.cos(), level * azimuth.sin(), range * elevation.sin()];
        points.push(xyz.map(|x| (x / SCALE).round() as i64));
    }
    if folder.ends_with("p5_cone_ptx") {
        let file = std::fs::File::create(folder.join("scan.ptx.gz"))?;
        let mut ptx = flate2::write::GzEncoder::new(file, flate2::Compression::fast());
        let frame = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1";
        writeln!(ptx, "{n_columns}\n{n_rows}\n{frame}")?;
        for [x, y, z] in points.iter().map(|point| point.map(|x| x as f64 * SCALE)) {
            writeln!(ptx, "{x:.5} {y:.5} {z:.5} 0.500000")?;
        }
        return ptx.finish().map(drop);
    }
    let file = folder.join("scan.e57");
    write_e57(&file, [n_columns, n_rows], &points).map_err(io::Error::other)
}

fn write_e57(file: &Path, [n_columns, n_rows]: [usize; 2], points: &[[i64; 3]]) -> e57::Result<()> {
    use RecordName::{CartesianX, CartesianY, CartesianZ, ColumnIndex, RowIndex};
    let coordinate = |name, k: usize| {
        let (min, max) = points.iter().fold((0, 0), |(min, max), p| (p[k].min(min), p[k].max(max)));
        Record { name, data_type: RecordDataType::ScaledInteger { min, max, scale: SCALE, offset: 0.0 } }
    };
    let index =
        |name, n: usize| Record { name, data_type: RecordDataType::Integer { min: 0, max: n as i64 - 1 } };
    let mut writer = E57Writer::from_file(file, "small sample")?;
    let prototype = vec![
        coordinate(CartesianX, 0),
        coordinate(CartesianY, 1),
        coordinate(CartesianZ, 2),
        index(RowIndex, n_rows),
        index(ColumnIndex, n_columns),
    ];
    let mut cloud = writer.add_pointcloud("small sample, scan", prototype)?;
    cloud.set_index_bounds(Some(IndexBounds {
        row_min: Some(0),
        row_max: Some(n_rows as i64 - 1),
        column_min: Some(0),
        column_max: Some(n_columns as i64 - 1),
        return_min: None,
        return_max: None,
    }));
    for (cell, point) in points.iter().enumerate().filter(|(_, point)| **point != [0; 3]) {
        let mut values: Vec<RecordValue> = point.iter().map(|x| RecordValue::ScaledInteger(*x)).collect();
        values.extend([cell % n_rows, cell / n_rows].map(|index| RecordValue::Integer(index as i64)));
        cloud.add_point(values)?;
    }
    cloud.finalize()?;
    writer.finalize()
}
