//! Reader of structured E57 files (ASTM E2807): points with `rowIndex` and `columnIndex`.
//!
//! The file is checked before it is parsed: its length against its header, then the CRC-32C of every page. Coordinates
//! may be Cartesian or spherical, float, double or scaled integer; missing cells may be flagged, left out, or written
//! as the origin. The pose is reported and not applied: the lattice stays in the scanner's frame. Cells are placed by
//! their indices, never by their order.
//!
//! Source also: Huber, "The ASTM E57 file format for 3D imaging data exchange", Proc. SPIE 7864, 2011.

mod compressed_vector;
mod values;

use std::io::{Read, Seek, SeekFrom};

use e57::{E57Reader, IndexBounds, PointCloud, Record, RecordDataType, RecordName};
use platen_scan::{Direction, State};

use super::cells::Cells;
use super::error::{ReadError, Result};
use super::{About, Source};
use crate::header_text;
use crate::orient::{Converted, Position, ToSpherical};
use compressed_vector::{CompressedVector, Points};
use values::Values;

const FORMAT: &str = "E57";
const PAGE: u64 = 1024;

/// Seconds from the Unix epoch to that of GPS, less the 18 leap seconds by which UTC lags since 2017.
pub(crate) const GPS_EPOCH_UNIX_S: f64 = 315_964_800.0 - 18.0;

/// One scan of an E57 file.
pub(crate) struct E57<R: Read + Seek> {
    file: R,
    cloud: PointCloud,
    fields: Fields,
    about: About,
}

impl<R: Read + Seek> E57<R> {
    /// Checks the file and finds the scan; `chosen` counts from 1 and is optional when the file contains one scan.
    pub(crate) fn open(mut file: R, chosen: Option<usize>) -> Result<Self> {
        let length_note = check_length(&mut file)?;
        check_pages(&mut file)?;
        let clouds = E57Reader::new(&mut file).map_err(|e| unsound(chain(&e)))?.pointclouds();
        let cloud = choose(clouds, chosen)?;
        check_prototype(&cloud.prototype)?;
        let fields = Fields::find(&cloud)?;
        let mut about = About { format: fields.format(), ..describe(&cloud) };
        about.notes.extend(length_note);
        if fields.return_index.is_some() {
            about.notes.push("several echoes per beam: the first of each is used".to_owned());
        }
        Ok(Self { file, cloud, fields, about })
    }
}

impl<R: Read + Seek + Send> Source for E57<R> {
    fn about(&self) -> &About {
        &self.about
    }

    fn cells(&mut self) -> Result<Box<dyn Cells + '_>> {
        let PointCloud { file_offset, prototype, records, .. } = &self.cloud;
        let packets = CompressedVector::open(&mut self.file, *file_offset, prototype, *records);
        let (packets, fields) = (packets.map_err(unsound)?, &self.fields);
        Ok(Box::new(PacketCells { packets, fields, values: Values::default(), before: 0 }))
    }
}

/// Cells of the packets, one packet after the other.
struct PacketCells<'a, R> {
    packets: CompressedVector<R>,
    fields: &'a Fields,
    values: Values,
    /// Number of points in the previous packets.
    before: u64,
}

impl<R: Read + Seek + Send> Cells for PacketCells<'_, R> {
    fn append(&mut self, to_spherical: &mut ToSpherical, batch: &mut Converted) -> Result<()> {
        while batch.parts.is_empty() {
            let wrong = |number: u64, what| unsound(format!("point {number}: {what}"));
            let packet = self.packets.next().map_err(|what| wrong(self.before, what))?;
            let Some(points) = packet else { return Ok(()) };
            let values = &mut self.values;
            self.fields.read(points, values);
            let sound = self.fields.check(values);
            if let Err((point, _)) = &sound {
                values.truncate(*point);
            }
            values.keep_first_echoes();
            self.fields.append(values, to_spherical, batch);
            sound.map_err(|(point, what)| wrong(self.before + point as u64, what))?;
            self.before += points.len() as u64;
        }
        Ok(())
    }
}

fn unsound(what: String) -> ReadError {
    ReadError::Unsound(FORMAT, what)
}

/// Returns the message of the `e57` crate with the causes that it does not repeat, in one line.
pub(crate) fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let more = inner.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        cause = inner.source();
    }
    // The XML parser quotes the offending character, which may be a line break.
    text.replace(char::is_control, " ")
}

/// Compares the header with the length of the file; returns a note on a harmless difference.
fn check_length<R: Read + Seek>(file: &mut R) -> Result<Option<String>> {
    let incomplete = |what| Err(ReadError::Incomplete(FORMAT, what));
    let length = file.seek(SeekFrom::End(0)).map_err(ReadError::io("finding the length"))?;
    file.rewind().map_err(ReadError::io("going back to the start"))?;
    if length < PAGE {
        return incomplete(format!("{length} bytes, at least {PAGE} needed"));
    }
    let mut header = [0; 48];
    file.read_exact(&mut header).map_err(ReadError::io("reading the header"))?;
    file.rewind().map_err(ReadError::io("going back to the start"))?;
    let field = |at: usize| header[at..at + 8].iter().rev().fold(0, |n, b| n << 8 | u64::from(*b));
    let (declared, xml_offset, xml_length, page) = (field(16), field(24), field(32), field(40));
    if page != PAGE {
        return Err(unsound(format!("page size {page} instead of {PAGE}")));
    }
    let whole_pages = length.is_multiple_of(PAGE);
    if length < declared.saturating_sub(1) || !whole_pages {
        return incomplete(format!("{length} bytes, {declared} announced"));
    }
    if xml_offset >= length || xml_length > length {
        return incomplete(format!("its table of contents ({xml_length} bytes at {xml_offset}) is missing"));
    }
    // Some writers are off by one here; every page is checked in any case.
    if length.abs_diff(declared) == 1 {
        return Ok(Some(format!("the header announces {declared} bytes, the file has {length}")));
    }
    if length > declared {
        return Err(unsound(format!("{length} bytes, only {declared} announced")));
    }
    Ok(None)
}

/// Checks the CRC-32C at the end of every page, which is big-endian, unlike all other numbers of the file.
fn check_pages<R: Read + Seek>(file: &mut R) -> Result<()> {
    let mut page = [0; PAGE as usize];
    let mut number = 0_u64;
    loop {
        match file.read_exact(&mut page) {
            Ok(()) => number += 1,
            Err(end) if end.kind() == std::io::ErrorKind::UnexpectedEof => break,
            Err(error) => return Err(ReadError::Io { doing: "reading pages", source: error }),
        }
        let (content, checksum) = page.split_at(page.len() - 4);
        if crc32c::crc32c(content).to_be_bytes() != checksum {
            return Err(ReadError::Damaged(FORMAT, format!("the checksum of page {number} is wrong")));
        }
    }
    file.rewind().map_err(ReadError::io("going back to the start"))
}

/// Returns the chosen scan, or the only one that contains points.
fn choose(clouds: Vec<PointCloud>, chosen: Option<usize>) -> Result<PointCloud> {
    let held = clouds.len();
    if let Some(chosen) = chosen {
        let missing = ReadError::NoSuchCloud(FORMAT, held, chosen);
        return chosen.checked_sub(1).and_then(|i| clouds.into_iter().nth(i)).ok_or(missing);
    }
    let name = |(i, cloud): (usize, &PointCloud)| {
        format!("{}: {} points {}", i + 1, cloud.records, cloud.name.as_deref().unwrap_or("without name"))
    };
    let scans: Vec<String> = clouds.iter().enumerate().map(name).collect();
    let mut filled = clouds.into_iter().filter(|cloud| cloud.records > 0);
    match (filled.next(), filled.next()) {
        (Some(cloud), None) => Ok(cloud),
        (Some(_), Some(_)) => Err(ReadError::Several(FORMAT, scans)),
        (None, _) => Err(unsound("it holds no points".to_owned())),
    }
}

/// Refuses a prototype in which no record occupies any bits: the data would never end, and the reader would fill all
/// memory.
fn check_prototype(prototype: &[Record]) -> Result<()> {
    let takes_bits = |record: &Record| match record.data_type {
        RecordDataType::Single { .. } | RecordDataType::Double { .. } => true,
        RecordDataType::ScaledInteger { min, max, .. } | RecordDataType::Integer { min, max } => max > min,
    };
    if prototype.iter().any(takes_bits) {
        Ok(())
    } else {
        Err(unsound("no field of a point takes any space".to_owned()))
    }
}

fn describe(cloud: &PointCloud) -> About {
    let parts = [&cloud.sensor_vendor, &cloud.sensor_model, &cloud.sensor_serial];
    let instrument: Vec<&str> =
        parts.into_iter().flatten().map(|s| s.trim()).filter(|s| !s.is_empty()).collect();
    let mut notes = Vec::new();
    if let Some(pose) = &cloud.transform {
        let (r, t) = (&pose.rotation, &pose.translation);
        if (r.x, r.y, r.z, t.x, t.y, t.z) != (0.0, 0.0, 0.0, 0.0, 0.0, 0.0) {
            notes.push(format!(
                "the file's pose (quaternion {} {} {} {}, at {} {} {} m) is not applied: the lattice stays in the scanner's frame",
                r.w, r.x, r.y, r.z, t.x, t.y, t.z
            ));
        }
    }
    About {
        cells: cloud.records,
        intensity: declared_intensity(cloud),
        instrument: instrument.join(" "),
        acquired_unix_s: cloud.acquisition_start.as_ref().map(|time| time.gps_time + GPS_EPOCH_UNIX_S),
        written: cloud.description.as_deref().and_then(header_text::from_text),
        notes,
        ..About::default()
    }
}

/// Returns `intensityLimits`, which are in the unit of the values but may be written as raw scaled integers.
fn declared_intensity(cloud: &PointCloud) -> Option<(f64, f64)> {
    let limits = cloud.intensity_limits.as_ref()?;
    let record = cloud.prototype.iter().find(|record| record.name == RecordName::Intensity)?;
    let value = |limit: &e57::RecordValue| limit.to_f64(&record.data_type).ok();
    Some((value(limits.intensity_min.as_ref()?)?, value(limits.intensity_max.as_ref()?)?))
}

/// One field of a point.
#[derive(Debug, Clone)]
struct Field {
    index: usize,
    data_type: RecordDataType,
}

/// Fields of a point that make up a cell, with the bounds of its indices.
#[derive(Debug)]
struct Fields {
    position: [Field; 3],
    spherical: bool,
    state: Option<Field>,
    row: Field,
    column: Field,
    bounds: [(i64, i64); 2],
    intensity: Option<Field>,
    return_index: Option<Field>,
}

impl Fields {
    fn find(cloud: &PointCloud) -> Result<Self> {
        let find = |name: RecordName| {
            let index = cloud.prototype.iter().position(|record| record.name == name)?;
            Some(Field { index, data_type: cloud.prototype[index].data_type.clone() })
        };
        let all = |names: [RecordName; 3]| {
            let [a, b, c] = names.map(find);
            Some([a?, b?, c?])
        };
        let cartesian = all([RecordName::CartesianX, RecordName::CartesianY, RecordName::CartesianZ]);
        let spherical = cartesian.is_none();
        let position = cartesian
            .or_else(|| {
                all([
                    RecordName::SphericalRange,
                    RecordName::SphericalAzimuth,
                    RecordName::SphericalElevation,
                ])
            })
            .ok_or_else(|| unsound("its points have no position".to_owned()))?;
        let state =
            if spherical { RecordName::SphericalInvalidState } else { RecordName::CartesianInvalidState };
        let (Some(row), Some(column)) = (find(RecordName::RowIndex), find(RecordName::ColumnIndex)) else {
            return Err(ReadError::Refused(
                format!("unorganised E57 ({} points without row and column)", cloud.records),
                "the lattice was lost on export; export a structured E57 (gridded, one scan, every point)",
            ));
        };
        Ok(Self {
            position,
            spherical,
            state: find(state),
            row,
            column,
            bounds: bounds(cloud.index_bounds.as_ref()),
            intensity: find(RecordName::Intensity),
            return_index: find(RecordName::ReturnIndex),
        })
    }

    /// Describes the encoding of the cells.
    fn format(&self) -> String {
        let numbers = match self.position[0].data_type {
            RecordDataType::Single { .. } => "f32".to_owned(),
            RecordDataType::Double { .. } => "f64".to_owned(),
            RecordDataType::ScaledInteger { scale, .. } => format!("scaled integers of {scale}"),
            RecordDataType::Integer { .. } => "integers".to_owned(),
        };
        let coordinates = if self.spherical { "spherical" } else { "Cartesian" };
        let gaps = if self.state.is_some() { "gaps flagged" } else { "gaps not flagged" };
        format!("{FORMAT}: {coordinates} coordinates, {numbers}, {gaps}")
    }

    /// Reads the fields of all points of a packet.
    fn read(&self, points: &Points, values: &mut Values) {
        let numbers = |field: &Field, into: &mut Vec<f64>| points.numbers(field.index, into);
        let wholes = |field: &Field, into: &mut Vec<i64>| points.wholes(field.index, into);
        self.position.iter().zip(&mut values.position).for_each(|(field, into)| numbers(field, into));
        wholes(&self.row, &mut values.row);
        wholes(&self.column, &mut values.column);
        self.intensity.iter().for_each(|field| numbers(field, &mut values.intensity));
        self.state.iter().for_each(|field| wholes(field, &mut values.state));
        self.return_index.iter().for_each(|field| wholes(field, &mut values.echo));
    }

    /// Checks indices and states.
    ///
    /// # Errors
    /// The first point that is wrong, with the message.
    fn check(&self, values: &Values) -> std::result::Result<(), (usize, String)> {
        let [rows, columns] = self.bounds;
        let lines = [("row", &values.row, rows), ("column", &values.column, columns)];
        let outside = lines.into_iter().filter_map(|(name, numbers, (min, max))| {
            let (point, number) = values.first_outside(numbers, min.max(0)..=max.min(i64::from(u32::MAX)))?;
            Some((point, format!("{name} {number} lies outside of the declared {min} to {max}")))
        });
        let undefined = values.first_outside(&values.state, 0..=2);
        let undefined =
            undefined.map(|(point, state)| (point, format!("invalid state {state}, 0 to 2 are defined")));
        outside.chain(undefined).min_by_key(|(point, _)| *point).map_or(Ok(()), Err)
    }

    /// Appends the cells of points that were checked.
    fn append(&self, values: &Values, to_spherical: &mut ToSpherical, batch: &mut Converted) {
        let n = values.row.len();
        let cells = &mut batch.cells;
        cells
            .places
            .extend(values.row.iter().zip(&values.column).map(|(row, column)| [*row as u32, *column as u32]));
        cells.intensity.extend_from_slice(&values.intensity);
        cells.intensity.resize(cells.len(), 0.0);
        cells.state.extend(values.state.iter().map(|state| match state {
            0 => State::Valid,
            1 => State::DirectionOnly,
            _ => State::NoReturn,
        }));
        cells.state.resize(cells.len(), State::Valid);
        let [a, b, c] = values.position.each_ref().map(|numbers| &numbers[..n]);
        if self.spherical {
            let is_direction = |point: usize| values.state.get(point) == Some(&1);
            let position = |point: usize| spherical(a[point], b[point], c[point], is_direction(point));
            to_spherical.append_positions((0..n).map(position), batch);
        } else {
            let position = |point: usize| Position::Cartesian([a[point], b[point], c[point]]);
            to_spherical.append_positions((0..n).map(position), batch);
        }
    }
}

/// Returns smallest and largest row, then column. Without `indexBounds` any index from 0 is valid: the limits of the
/// prototype give the number of bits of an index, not the size of the lattice.
fn bounds(declared: Option<&IndexBounds>) -> [(i64, i64); 2] {
    let any = (0, i64::from(u32::MAX));
    let or_any = |min: Option<i64>, max: Option<i64>| (min.unwrap_or(any.0), max.unwrap_or(any.1));
    declared.map_or([any, any], |b| [or_any(b.row_min, b.row_max), or_any(b.column_min, b.column_max)])
}

/// Returns a position by range and direction. A range that is not positive becomes 0 (no measurement); where only the
/// direction is known the range is 1 m.
fn spherical(range: f64, azimuth: f64, elevation: f64, is_direction: bool) -> Position {
    let range = if is_direction { 1.0 } else { range.max(0.0) };
    Position::Spherical(range, Direction { azimuth, elevation })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// PDAL writes states as floats, other programs as the widest integers.
    #[test]
    fn states_of_any_type_are_read() {
        let double = RecordDataType::Double { min: None, max: None };
        let integer = RecordDataType::Integer { min: i64::MIN, max: i64::MAX };
        let single = RecordDataType::Single { min: None, max: None };
        let widest: fn(i64) -> Vec<u8> = |n| n.wrapping_sub(i64::MIN).to_le_bytes().to_vec();
        let float: fn(i64) -> Vec<u8> = |n| (n as f32).to_le_bytes().to_vec();
        for (data_type, bytes) in [(&integer, widest), (&single, float)] {
            let types = [&double, &double, &double, data_type, &integer];
            let field = |index: usize| Field { index, data_type: types[index].clone() };
            let fields = Fields {
                position: [0, 1, 2].map(field),
                spherical: false,
                state: Some(field(3)),
                row: field(4),
                column: field(4),
                bounds: bounds(None),
                intensity: None,
                return_index: None,
            };
            let read = |number| {
                let mut streams = vec![1.0_f64.to_le_bytes().to_vec(); 3];
                streams.extend([bytes(number), widest(5)]);
                let mut values = Values::default();
                fields.read(&Points::of(&types, &streams), &mut values);
                let mut batch = Converted::default();
                fields.check(&values)?;
                fields.append(&values, &mut ToSpherical::default(), &mut batch);
                Ok::<_, (usize, String)>(batch.cells.state[0])
            };
            assert_eq!(read(0), Ok(State::Valid));
            assert_eq!(read(1), Ok(State::DirectionOnly));
            assert_eq!(read(2), Ok(State::NoReturn));
            assert!(read(3).is_err() && read(-1).is_err());
        }
    }
}
