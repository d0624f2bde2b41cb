//! Small lattice, written in every encoding that a format allows.

use std::fmt::Write as _;
use std::io::Cursor;

use e57::{
    E57Writer, IntensityLimits, Quaternion, Record, RecordDataType, RecordName, RecordValue, Transform,
    Translation,
};
use platen_scan::Direction;

pub(super) const ROWS: u32 = 24;
pub(super) const COLUMNS: u32 = 32;
const STEP: f64 = 0.012;

/// Returns true where the lattice has a gap.
pub(super) fn missing(row: u32, column: u32) -> bool {
    (3 * row + column).is_multiple_of(11)
}

/// Returns direction and range of a cell: row 0 at the top, columns by increasing azimuth, across the seam at pi.
pub(super) fn beam(row: u32, column: u32) -> (Direction, f64) {
    let direction =
        Direction { azimuth: 3.0 + STEP * f64::from(column), elevation: 0.1 - STEP * f64::from(row) };
    (direction, 5.0 + 0.03 * f64::from(row) + 0.02 * f64::from(column))
}

/// Returns the point of a cell, metres.
pub(super) fn point(row: u32, column: u32) -> [f64; 3] {
    let (direction, range) = beam(row, column);
    direction.unit().map(|c| c * range)
}

pub(super) fn intensity(row: u32, column: u32) -> f64 {
    f64::from(row * COLUMNS + column)
}

/// Representation of missing cells.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Gaps {
    Flagged,
    LeftOut,
    Zero,
    Nan,
}

/// Settings of a written E57 file.
#[derive(Clone, Copy)]
pub(super) struct E57Style {
    pub(super) spherical: bool,
    pub(super) coordinates: fn(RecordName) -> Record,
    pub(super) gaps: Gaps,
    pub(super) offset: i64,
    pub(super) posed: bool,
    pub(super) scale: f64,
    pub(super) azimuth_turns: f64,
    /// Every third beam has a second echo, 2 m behind.
    pub(super) echoes: bool,
}

pub(super) fn double(name: RecordName) -> Record {
    Record { name, data_type: RecordDataType::Double { min: None, max: None } }
}

pub(super) fn single(name: RecordName) -> Record {
    Record { name, data_type: RecordDataType::Single { min: None, max: None } }
}

/// Returns a record scaled to ten micrometres.
pub(super) fn scaled(name: RecordName) -> Record {
    let data_type =
        RecordDataType::ScaledInteger { min: -2_000_000, max: 2_000_000, scale: 1e-5, offset: 0.25 };
    Record { name, data_type }
}

fn narrow(name: RecordName) -> Record {
    Record { name, data_type: RecordDataType::Integer { min: 0, max: 2 } }
}

pub(super) const PLAIN: E57Style = E57Style {
    spherical: false,
    coordinates: double,
    gaps: Gaps::Flagged,
    offset: 0,
    posed: false,
    scale: 1.0,
    azimuth_turns: 0.0,
    echoes: false,
};

fn value(record: &Record, value: f64) -> RecordValue {
    match record.data_type {
        RecordDataType::Double { .. } => RecordValue::Double(value),
        RecordDataType::Single { .. } => RecordValue::Single(value as f32),
        RecordDataType::Integer { .. } => RecordValue::Integer(value as i64),
        RecordDataType::ScaledInteger { scale, offset, .. } => {
            RecordValue::ScaledInteger(((value - offset) / scale).round() as i64)
        }
    }
}

/// Returns the lattice as an E57 file; `clouds` copies of it.
pub(super) fn e57(style: E57Style, clouds: usize) -> Vec<u8> {
    file_of(|writer| (0..clouds).for_each(|number| add_cloud(writer, style, number, None)))
}

/// Returns the lattice as an E57 file whose point cloud has a description.
pub(super) fn described(style: E57Style, description: &str) -> Vec<u8> {
    file_of(|writer| add_cloud(writer, style, 0, Some(description.to_owned())))
}

type Writer<'a> = E57Writer<&'a mut Cursor<Vec<u8>>>;

fn file_of(fill: impl FnOnce(&mut Writer<'_>)) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut file, "file").unwrap();
    fill(&mut writer);
    writer.finalize().unwrap();
    drop(writer);
    file.into_inner()
}

fn add_cloud(writer: &mut Writer<'_>, style: E57Style, number: usize, description: Option<String>) {
    use RecordName::*;
    let (names, state) = if style.spherical {
        ([SphericalRange, SphericalAzimuth, SphericalElevation], SphericalInvalidState)
    } else {
        ([CartesianX, CartesianY, CartesianZ], CartesianInvalidState)
    };
    let mut prototype: Vec<Record> = names.into_iter().map(style.coordinates).collect();
    prototype.push(narrow(state));
    prototype.push(Record { name: RowIndex, data_type: RecordDataType::Integer { min: 0, max: 16383 } });
    prototype.push(Record { name: ColumnIndex, data_type: RecordDataType::Integer { min: 0, max: 16383 } });
    prototype.push(Record { name: Intensity, data_type: RecordDataType::Integer { min: 0, max: 2047 } });
    if style.echoes {
        prototype.extend([ReturnIndex, ReturnCount].map(narrow));
    }
    let mut cloud = writer.add_pointcloud(&format!("cloud {number}"), prototype.clone()).unwrap();
    cloud.set_intensity_limits(Some(IntensityLimits {
        intensity_min: Some(RecordValue::Integer(0)),
        intensity_max: Some(RecordValue::Integer(2047)),
    }));
    cloud.set_description(description);
    if style.posed {
        cloud.set_transform(Some(Transform {
            rotation: Quaternion { w: 0.5, x: 0.5, y: 0.5, z: 0.5 },
            translation: Translation { x: 100.0, y: -20.0, z: 3.0 },
        }));
    }
    for column in 0..COLUMNS {
        for row in 0..ROWS {
            let gap = missing(row, column);
            if gap && style.gaps == Gaps::LeftOut {
                continue;
            }
            let (direction, range) = beam(row, column);
            let n_echoes = if style.echoes && (row + column).is_multiple_of(3) { 2 } else { 1 };
            for echo in 0..n_echoes {
                let behind = 2.0 * f64::from(echo);
                let position = if style.spherical {
                    let azimuth = direction.azimuth + style.azimuth_turns * std::f64::consts::TAU;
                    [(range + behind) * style.scale, azimuth, direction.elevation]
                } else {
                    direction.unit().map(|c| c * (range + behind) * style.scale)
                };
                let (position, flag) = match style.gaps {
                    _ if !gap => (position, 0.0),
                    Gaps::Zero => ([0.0; 3], 0.0),
                    Gaps::Nan => ([f64::NAN; 3], 0.0),
                    Gaps::Flagged | Gaps::LeftOut => ([1.0; 3], 2.0),
                };
                let index = |i: u32| f64::from(i) + style.offset as f64;
                let numbers = position.into_iter().chain([flag, index(row), index(column)]);
                let numbers = numbers.chain([intensity(row, column), f64::from(echo), f64::from(n_echoes)]);
                let point =
                    prototype.iter().zip(numbers).map(|(record, number)| value(record, number)).collect();
                cloud.add_point(point).unwrap();
            }
        }
    }
    cloud.finalize().unwrap();
}

/// Settings of a written PTX file.
#[derive(Clone, Copy)]
pub(super) struct PtxStyle {
    pub(super) header_end: &'static str,
    pub(super) cell_end: &'static str,
    pub(super) bottom_up: bool,
    pub(super) clockwise: bool,
    pub(super) left_handed: bool,
    pub(super) colour: bool,
    pub(super) mark: &'static str,
}

pub(super) const PTX: PtxStyle = PtxStyle {
    header_end: "\n",
    cell_end: "\n",
    bottom_up: false,
    clockwise: false,
    left_handed: false,
    colour: false,
    mark: "",
};

/// Returns the lattice as a PTX file with the first `columns` stored.
pub(super) fn ptx(style: PtxStyle, columns: u32) -> Vec<u8> {
    let mut text = style.mark.to_owned();
    let end = style.header_end;
    write!(text, "{columns}{end}{ROWS}{end}0 0 0{end}1 0 0{end}0 1 0{end}0 0 1{end}").unwrap();
    let y = if style.left_handed { -1 } else { 1 };
    write!(text, "1 0 0 0{end}0 {y} 0 0{end}0 0 1 0{end}0 0 0 1{end}").unwrap();
    for column in 0..columns {
        let column = if style.clockwise { COLUMNS - 1 - column } else { column };
        for row in 0..ROWS {
            let row = if style.bottom_up { ROWS - 1 - row } else { row };
            let [x, y, z] = if missing(row, column) { [0.0; 3] } else { point(row, column) };
            let y = if style.left_handed { -y } else { y };
            let i = intensity(row, column) / 1000.0;
            let colour = if style.colour { " 1 2 3" } else { "" };
            write!(text, "{x:.7} {y:.7} {z:.7} {i:.4}{colour}{}", style.cell_end).unwrap();
        }
    }
    text.into_bytes()
}

/// Returns the lattice as XYZ text: `head`, then row, column, x, y, z and `tail` per cell; rows and columns `swapped`
/// on request.
pub(super) fn xyz(head: &str, tail: &str, swapped: bool, end: &str) -> Vec<u8> {
    let mut text = head.to_owned();
    for column in 0..COLUMNS {
        for row in (0..ROWS).filter(|row| !missing(*row, column)) {
            let [x, y, z] = point(row, column);
            let (a, b) = if swapped { (column, row) } else { (row, column) };
            write!(text, "{a} {b} {x:.7} {y:.7} {z:.7}{tail}{end}").unwrap();
        }
    }
    text.into_bytes()
}

/// Returns the lattice as an XYB file: `sizes` in the header, all cells or hits only, along columns or along rows.
pub(super) fn xyb(sizes: (u32, u32), all: bool, along_rows: bool, missing_as: f64) -> Vec<u8> {
    let (rows, columns) = sizes;
    let head =
        format!("# SCENE XYZ binary format v1.0\nScanPosition 1.0 2.0 3.0 \nRows {rows}\nCols {columns}\n");
    let mut file = [head.as_bytes(), &[0; 4]].concat();
    let cells = (0..ROWS * COLUMNS)
        .map(|i| if along_rows { (i / COLUMNS, i % COLUMNS) } else { (i % ROWS, i / ROWS) });
    for (row, column) in cells.filter(|(row, column)| all || !missing(*row, *column)) {
        let xyz = if missing(row, column) { [missing_as; 3] } else { point(row, column) };
        xyz.iter().for_each(|c| file.extend(c.to_le_bytes()));
        file.extend((intensity(row, column) as u16).to_le_bytes());
    }
    file
}
