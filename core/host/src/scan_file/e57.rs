//! E57: range, azimuth and elevation as 64-bit floats, so that nothing is rounded on the way.
//!
//! Only cells are stored of which something is known. What the format has no place for (nominal angles, the size of
//! the lattice beyond the cells stored, warm-up columns, notes) goes into the description of the point cloud as
//! [`ScanHeader::to_text`] writes it; other readers show it as a remark.

use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use e57::{
    DateTime, E57Writer, IntensityLimits, PointCloudWriter, Record, RecordDataType, RecordName, RecordValue,
};
use platen_scan::{Column, ScanEnd, ScanHeader, State, wrap_azimuth};

use super::{Encoder, ScanFileError};

/// Largest row and column number that fits.
const MAX_INDEX: i64 = (1 << 17) - 1;
/// Seconds from the Unix epoch to that of GPS, less the 18 leap seconds by which UTC lags since 2017.
const GPS_EPOCH_UNIX_S: f64 = 315_964_800.0 - 18.0;

/// The file, before and after its one point cloud.
pub(super) struct File {
    writer: E57Writer<std::fs::File>,
    path: PathBuf,
}

impl File {
    pub(super) fn create(part: &Path, path: &Path) -> Result<Self, ScanFileError> {
        let writer = E57Writer::from_file(part, &guid("file")).map_err(failed(path))?;
        Ok(Self { writer, path: path.to_path_buf() })
    }

    /// The point cloud; one for each file.
    pub(super) fn cloud(&mut self) -> Result<Cloud<'_, std::fs::File>, ScanFileError> {
        let cloud = self.writer.add_pointcloud(&guid("scan"), prototype()).map_err(failed(&self.path))?;
        Ok(Cloud { cloud, path: &self.path, header: ScanHeader::default() })
    }

    pub(super) fn finish(mut self) -> Result<(), ScanFileError> {
        self.writer.finalize().map_err(failed(&self.path))
    }
}

fn failed(path: &Path) -> impl Fn(e57::Error) -> ScanFileError + use<> {
    let path = path.to_path_buf();
    move |error| {
        let what = match std::error::Error::source(&error) {
            Some(cause) => format!("{error}: {cause}"),
            None => error.to_string(),
        };
        ScanFileError::E57 { path: path.clone(), what }
    }
}

/// Unique by time and process.
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

/// The point cloud while columns come.
pub(super) struct Cloud<'a, W: Read + Write + Seek> {
    cloud: PointCloudWriter<'a, W>,
    path: &'a Path,
    header: ScanHeader,
}

impl<W: Read + Write + Seek> Encoder for Cloud<'_, W> {
    fn begin(&mut self, header: &ScanHeader) -> Result<(), ScanFileError> {
        self.header = header.clone();
        Ok(())
    }

    fn column(&mut self, column: &Column) -> Result<(), ScanFileError> {
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
            self.cloud.add_point(values).map_err(failed(self.path))?;
        }
        Ok(())
    }

    fn end(&mut self, end: &ScanEnd) -> Result<(), ScanFileError> {
        let header = &self.header;
        let (min, max) = header.intensity_range;
        let limit = |value: u16| Some(RecordValue::Integer(i64::from(value)));
        self.cloud.set_intensity_limits(Some(IntensityLimits {
            intensity_min: limit(min),
            intensity_max: limit(max),
        }));
        self.cloud.set_description(Some(character_data(&header.to_text(end.warm_up_columns))));
        self.cloud.set_sensor_model(Some(character_data(&header.instrument)));
        self.cloud.set_acquisition_start(
            header
                .acquired_unix_s
                .map(|unix| DateTime { gps_time: unix - GPS_EPOCH_UNIX_S, atomic_reference: false }),
        );
        self.cloud.finalize().map_err(failed(self.path))
    }
}

/// Text that can stand in a CDATA section of XML.
fn character_data(text: &str) -> String {
    let text: String = text.chars().filter(|c| !c.is_control() || *c == '\n').collect();
    text.replace("]]>", "]] >")
}
