//! Sample scans as columns.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "test code of which every file uses its own part"
)]

use std::f64::consts::TAU;
use std::path::Path;

use platen_scan::{Column, Direction, ScanHeader, State, wrap_azimuth};
use platen_shape::extract::{Extractor, Refusal};
use platen_shape::{Patch, PlateSpec, Vec3};
use serde_json::Value;

/// A scan in memory and the truth about its plate.
pub struct Sample {
    pub header: ScanHeader,
    pub columns: Vec<Column>,
    pub spec: PlateSpec,
    pub truth: Value,
}

pub fn vec3(value: &Value) -> Vec3 {
    Vec3::from_iterator((0..3).map(|k| value[k].as_f64().unwrap()))
}

/// Reads one sample plate.
pub fn read(folder: &Path) -> Sample {
    let json = |name: &str| -> Value {
        serde_json::from_str(&std::fs::read_to_string(folder.join(name)).unwrap()).unwrap()
    };
    let (truth, job) = (json("truth.json"), json("job.json"));
    let e57 = folder.join("scan.e57");
    let cells = if e57.exists() { read_e57(&e57) } else { read_ptx_gz(&folder.join("scan.ptx.gz")) };
    let (header, columns) = lattice(&cells);
    let plate = &job["plate"];
    let metres = |key: &str| plate[key].as_f64().unwrap() / 1000.0;
    let spec = PlateSpec {
        width: metres("W_mm"),
        height: metres("H_mm"),
        thickness: metres("thickness_mm"),
        face_inset: 0.0,
        root_face: 0.0,
        u_axis: Some(vec3(&job["u_axis_hint"])),
        region: None,
    };
    Sample { header, columns, spec, truth }
}

/// Extracts the plate's face from columns that arrive in `order`.
pub fn extract(sample: &Sample, order: impl Iterator<Item = usize>) -> Result<Patch, Refusal> {
    let mut extractor = Extractor::new(&sample.header, &sample.spec);
    for index in order {
        extractor.push(&sample.columns[index]).unwrap();
    }
    extractor.finish()
}

/// Cells as (slow index, fast index, position).
type Cells = Vec<(i64, i64, [f64; 3])>;

fn read_e57(path: &Path) -> Cells {
    let mut reader = e57::E57Reader::from_file(path).unwrap();
    let cloud = reader.pointclouds().remove(0);
    let mut simple = reader.pointcloud_simple(&cloud).unwrap();
    simple.apply_pose(false);
    simple.normalize_intensity(false);
    simple.spherical_to_cartesian(true);
    simple
        .filter_map(|point| {
            let point = point.unwrap();
            match point.cartesian {
                e57::CartesianCoordinate::Valid { x, y, z } => Some((point.column, point.row, [x, y, z])),
                _ => None,
            }
        })
        .collect()
}

fn read_ptx_gz(path: &Path) -> Cells {
    let out = std::process::Command::new("gzip").arg("-dc").arg(path).output().unwrap();
    let text = String::from_utf8(out.stdout).unwrap();
    let mut lines = text.lines();
    let _columns: usize = lines.next().unwrap().trim().parse().unwrap();
    let rows: usize = lines.next().unwrap().trim().parse().unwrap();
    lines
        .skip(8)
        .enumerate()
        .filter_map(|(i, line)| {
            let mut fields = line.split_ascii_whitespace().map(|f| f.parse::<f64>().unwrap());
            let point = [fields.next()?, fields.next()?, fields.next()?];
            (point != [0.0; 3]).then_some(((i / rows) as i64, (i % rows) as i64, point))
        })
        .collect()
}

/// Returns the mean step of `angle` per index, and the angle at index 0, by least squares.
fn line(pairs: impl Iterator<Item = (i64, f64)> + Clone) -> (f64, f64) {
    let n = pairs.clone().count() as f64;
    let (sx, sy) = pairs.clone().fold((0.0, 0.0), |(sx, sy), (i, a)| (sx + i as f64, sy + a));
    let (mx, my) = (sx / n, sy / n);
    let (sxx, sxy) = pairs.fold((0.0, 0.0), |(sxx, sxy), (i, a)| {
        let dx = i as f64 - mx;
        (sxx + dx * dx, sxy + dx * (a - my))
    });
    (sxy / sxx, my - sxy / sxx * mx)
}

/// Brings cells into the order of the lattice: row 0 at the top, columns by increasing azimuth.
fn lattice(cells: &Cells) -> (ScanHeader, Vec<Column>) {
    let directions: Vec<_> = cells.iter().map(|c| Direction::of(c.2)).collect();
    let reference = directions[directions.len() / 2].azimuth;
    let azimuth = |i: usize| reference + wrap_azimuth(directions[i].azimuth - reference);
    let all = 0..cells.len();
    let (az_per_slow, az_at_0) = line(all.clone().map(|i| (cells[i].0, azimuth(i))));
    let (el_per_fast, el_at_0) = line(all.clone().map(|i| (cells[i].1, directions[i].elevation)));
    let max = |f: fn(&(i64, i64, [f64; 3])) -> i64| cells.iter().map(f).max().unwrap();
    let (last_slow, last_fast) = (max(|c| c.0), max(|c| c.1));
    let (flip_columns, flip_rows) = (az_per_slow < 0.0, el_per_fast > 0.0);
    let header = ScanHeader {
        n_rows: last_fast as u32 + 1,
        n_columns: last_slow as u32 + 1,
        azimuth_start: if flip_columns { az_at_0 + az_per_slow * last_slow as f64 } else { az_at_0 },
        azimuth_step: az_per_slow.abs(),
        elevation_start: if flip_rows { el_at_0 + el_per_fast * last_fast as f64 } else { el_at_0 },
        elevation_step: el_per_fast.abs(),
        intensity_range: (0, 1),
        simulated: true,
        instrument: "sample".into(),
        ..ScanHeader::default()
    };
    assert!(header.azimuth_step * f64::from(header.n_columns) < TAU * 1.01);
    let rows = header.n_rows as usize;
    let mut columns: Vec<_> = (0..header.n_columns)
        .map(|index| Column {
            index,
            range_m: vec![0.0; rows],
            azimuth: vec![0.0; rows],
            elevation: vec![0.0; rows],
            intensity: vec![0; rows],
            state: vec![State::NoReturn; rows],
            ..Column::default()
        })
        .collect();
    for (i, &(slow, fast, [x, y, z])) in cells.iter().enumerate() {
        let column = if flip_columns { last_slow - slow } else { slow } as usize;
        let row = if flip_rows { last_fast - fast } else { fast } as usize;
        let column = &mut columns[column];
        column.range_m[row] = (x * x + y * y + z * z).sqrt();
        column.azimuth[row] = directions[i].azimuth;
        column.elevation[row] = directions[i].elevation;
        column.state[row] = State::Valid;
    }
    (header, columns)
}
