//! E57 writer (ASTM E2807), structured: row and column indices, intensity and invalid state of every cell.

use super::{Cell, FileOrder, SimScan};
use crate::measure::INTENSITY_MAX;
use e57::{E57Writer, IntensityLimits, RawValues, Record, RecordDataType, RecordName, RecordValue, Result};
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Encoding of coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum E57Encoding {
    /// x, y, z in steps of 10 micrometres.
    #[default]
    CartesianScaled,
    /// x, y, z as 64-bit floats.
    CartesianDouble,
    /// x, y, z as 32-bit floats.
    CartesianSingle,
    /// Range, azimuth, elevation as 64-bit floats.
    Spherical,
}

/// Step of scaled coordinates, metres.
const SCALE: f64 = 1e-5;

/// Largest scaled coordinate, metres.
const LARGEST: f64 = 200.0;

impl E57Encoding {
    fn data_type(self) -> RecordDataType {
        let largest = (LARGEST / SCALE) as i64;
        match self {
            Self::CartesianScaled => {
                RecordDataType::ScaledInteger { min: -largest, max: largest, scale: SCALE, offset: 0.0 }
            }
            Self::CartesianSingle => RecordDataType::Single { min: None, max: None },
            Self::CartesianDouble | Self::Spherical => RecordDataType::Double { min: None, max: None },
        }
    }

    fn value(self, x: f64) -> RecordValue {
        match self {
            Self::CartesianScaled => RecordValue::ScaledInteger((x / SCALE).round() as i64),
            Self::CartesianSingle => RecordValue::Single(x as f32),
            Self::CartesianDouble | Self::Spherical => RecordValue::Double(x),
        }
    }

    fn names(self) -> [RecordName; 4] {
        use RecordName as N;
        match self {
            Self::Spherical => {
                [N::SphericalRange, N::SphericalAzimuth, N::SphericalElevation, N::SphericalInvalidState]
            }
            _ => [N::CartesianX, N::CartesianY, N::CartesianZ, N::CartesianInvalidState],
        }
    }

    /// Returns coordinates and invalid state: 0 valid, 1 direction only, 2 invalid.
    fn coordinates(self, cell: &Cell) -> ([f64; 3], i64) {
        match (self, cell.point(), cell.range) {
            (Self::Spherical, _, Some(range)) => ([range, wrapped(cell.azimuth), cell.elevation], 0),
            (Self::Spherical, _, None) => ([0.0, wrapped(cell.azimuth), cell.elevation], 1),
            (_, Some(point), _) => (point, 0),
            (_, None, _) => ([0.0; 3], 2),
        }
    }
}

/// Wraps an azimuth into (-pi, pi], as the standard requires.
fn wrapped(azimuth: f64) -> f64 {
    azimuth - TAU * ((azimuth - PI) / TAU).ceil()
}

fn prototype(encoding: E57Encoding, [rows, columns]: [u32; 2]) -> Vec<Record> {
    let integer = |max: u32| RecordDataType::Integer { min: 0, max: i64::from(max) };
    let [a, b, c, invalid] = encoding.names();
    let mut records: Vec<Record> =
        [a, b, c].map(|name| Record { name, data_type: encoding.data_type() }).into();
    records.push(Record { name: invalid, data_type: integer(2) });
    records.push(Record { name: RecordName::Intensity, data_type: integer(u32::from(INTENSITY_MAX)) });
    records.push(Record { name: RecordName::RowIndex, data_type: integer(rows - 1) });
    records.push(Record { name: RecordName::ColumnIndex, data_type: integer(columns - 1) });
    records
}

fn values(encoding: E57Encoding, cell: &Cell) -> RawValues {
    let (coordinates, invalid) = encoding.coordinates(cell);
    let mut values: RawValues = coordinates.map(|x| encoding.value(x)).into();
    let integers = [invalid, i64::from(cell.intensity), i64::from(cell.row), i64::from(cell.column)];
    values.extend(integers.map(RecordValue::Integer));
    values
}

/// Writes all cells; those without echo have an invalid state.
pub(super) fn write(scan: &SimScan, path: &Path, encoding: E57Encoding, order: FileOrder) -> Result<()> {
    let mut file = E57Writer::from_file(path, "platen-sim-file")?;
    let mut cloud = file.add_pointcloud("platen-sim-scan", prototype(encoding, scan.size(order)))?;
    cloud.set_sensor_vendor(Some("platen".to_owned()));
    cloud.set_sensor_model(Some("simulated scanner".to_owned()));
    cloud.set_intensity_limits(Some(IntensityLimits {
        intensity_min: Some(RecordValue::Integer(0)),
        intensity_max: Some(RecordValue::Integer(i64::from(INTENSITY_MAX))),
    }));
    for cell in scan.cells(order) {
        cloud.add_point(values(encoding, &cell))?;
    }
    cloud.finalize()?;
    file.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn azimuths_are_wrapped() {
        for (azimuth, expected) in [(0.5, 0.5), (PI, PI), (-PI, PI), (3.5, 3.5 - TAU), (-3.5, TAU - 3.5)] {
            assert!((wrapped(azimuth) - expected).abs() < 1e-15, "{azimuth}");
        }
    }
}
