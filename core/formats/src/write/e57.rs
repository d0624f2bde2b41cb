//! Writer of E57 files (ASTM E2807): range, azimuth and elevation as 64-bit floats, without rounding.
//!
//! Only cells of known direction are stored. Properties without a field in the format (nominal angles, the size of the
//! lattice beyond the cells stored, warm-up columns, notes) are written to the description of the point cloud
//! ([`crate::header_text`]); other readers show it as a remark.

use std::fs::File;
use std::time::{SystemTime, UNIX_EPOCH};

use e57::{
    DateTime, E57Writer, IntensityLimits, PointCloudWriter, Record, RecordDataType, RecordName, RecordValue,
};
use platen_scan::{Column, ScanEnd, ScanHeader, State, wrap_azimuth};

use super::Encoder;
use super::error::Result;
use crate::header_text;
use crate::read::e57::GPS_EPOCH_UNIX_S;

/// Largest row and column number of the prototype.
const MAX_INDEX: i64 = (1 << 17) - 1;

/// Starts a file.
pub(super) fn begin(file: File) -> Result<E57Writer<File>> {
    Ok(E57Writer::new(file, &guid("file"))?)
}

/// Returns an identifier that is unique by time and process.
fn guid(of: &str) -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
    format!("platen-{of}-{now:032x}-{:08x}", std::process::id())
}

fn prototype() -> Vec<Record> {
    let double = RecordDataType::Double { min: None, max: None };
    let integer = |max: i64| RecordDataType::Integer { min: 0, max };
    [
        (RecordName::SphericalRange, double.clone()),
        (RecordName::SphericalAzimuth, double.clone()),
        (RecordName::SphericalElevation, double),
        (RecordName::SphericalInvalidState, integer(2)),
        (RecordName::Intensity, integer(i64::from(u16::MAX))),
        (RecordName::RowIndex, integer(MAX_INDEX)),
        (RecordName::ColumnIndex, integer(MAX_INDEX)),
    ]
    .map(|(name, data_type)| Record { name, data_type })
    .into()
}

/// The point cloud of a file.
pub(super) struct Cloud<'a> {
    cloud: PointCloudWriter<'a, File>,
    header: ScanHeader,
}

impl<'a> Cloud<'a> {
    pub(super) fn new(writer: &'a mut E57Writer<File>, header: &ScanHeader) -> Result<Self> {
        Ok(Self { cloud: writer.add_pointcloud(&guid("scan"), prototype())?, header: header.clone() })
    }
}

impl Encoder for Cloud<'_> {
    fn column(&mut self, column: &Column) -> Result<()> {
        for i in 0..column.len() {
            let (range, state) = match column.state[i] {
                State::Valid => (column.range_m[i], 0),
                State::DirectionOnly => (0.0, 1),
                State::NoReturn => continue,
            };
            let row = i64::from(column.first_row) + i as i64;
            let integers = [state, i64::from(column.intensity[i]), row, i64::from(column.index)];
            let mut values = e57::RawValues::with_capacity(7);
            let azimuth = wrap_azimuth(column.azimuth[i]);
            values.extend([range, azimuth, column.elevation[i]].map(RecordValue::Double));
            values.extend(integers.map(RecordValue::Integer));
            self.cloud.add_point(values)?;
        }
        Ok(())
    }

    fn end(&mut self, end: &ScanEnd, _: &[bool]) -> Result<()> {
        let header = &self.header;
        let (min, max) = header.intensity_range;
        let limit = |value: u16| Some(RecordValue::Integer(i64::from(value)));
        self.cloud.set_intensity_limits(Some(IntensityLimits {
            intensity_min: limit(min),
            intensity_max: limit(max),
        }));
        self.cloud.set_description(Some(character_data(&header_text::to_text(header, end.warm_up_columns))));
        self.cloud.set_sensor_model(Some(character_data(&header.instrument)));
        self.cloud.set_acquisition_start(
            header
                .acquired_unix_s
                .map(|unix| DateTime { gps_time: unix - GPS_EPOCH_UNIX_S, atomic_reference: false }),
        );
        Ok(self.cloud.finalize()?)
    }
}

/// Returns text that is valid in a CDATA section of XML.
fn character_data(text: &str) -> String {
    let text: String = text.chars().filter(|c| !c.is_control() || *c == '\n').collect();
    text.replace("]]>", "]] >")
}
