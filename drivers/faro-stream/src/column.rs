//! Lattice announced by ScanBegin, and conversion of its columns to the order of `platen-scan`.

use platen_scan::{Column, Face, ScanHeader, State, data_sheet_range_error_m, wrap_azimuth};

use crate::error::{Error, Result};
use crate::message::{ScanBegin, Values};
use crate::wire::{u16_at, u32_at};

/// Limit of rows and of columns, above that of any scanner.
const MAX_LINES: u32 = 1 << 17;
/// Bytes before the bitmap.
const FIXED: usize = 24;
/// Unit of angles in a record, radians.
const NANORADIAN: f64 = 1e-9;

/// Checked lattice of a ScanBegin.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Layout {
    begin: ScanBegin,
}

impl Layout {
    /// Checks the lattice of a ScanBegin.
    pub(crate) fn new(begin: ScanBegin) -> Result<Self> {
        let lines = 1..=MAX_LINES;
        let angle = |a: f64| a.is_finite() && a.abs() <= 7.0;
        let step = |s: f64| angle(s) && s != 0.0;
        let sound = lines.contains(&begin.rows)
            && lines.contains(&begin.columns)
            && angle(begin.azimuth_start)
            && angle(begin.elevation_start)
            && step(begin.azimuth_step)
            && step(begin.elevation_step)
            && begin.range_unit_m > 0.0
            && begin.range_unit_m <= 1.0
            && begin.range_error_m.is_none_or(|error| (0.0..=1.0).contains(&error))
            && begin.intensity.0 <= begin.intensity.1
            && begin.seam_column.is_none_or(|seam| seam < begin.columns);
        if sound {
            Ok(Self { begin })
        } else {
            Err(Error::Bridge(format!("invalid lattice in ScanBegin: {begin:?}")))
        }
    }

    pub(crate) fn begin(&self) -> &ScanBegin {
        &self.begin
    }

    fn columns_flipped(&self) -> bool {
        self.begin.azimuth_step < 0.0
    }

    fn rows_flipped(&self) -> bool {
        self.begin.elevation_step > 0.0
    }

    /// Returns the header of the scan, rows from the top and columns by increasing azimuth.
    pub(crate) fn header(&self, scanner: &str) -> ScanHeader {
        let b = &self.begin;
        let first = if self.columns_flipped() { b.columns - 1 } else { 0 };
        let top = if self.rows_flipped() { b.rows - 1 } else { 0 };
        let mut notes = b.altered.clone();
        if self.columns_flipped() {
            notes.push("columns run clockwise at the bridge: columns reversed".to_owned());
        }
        if self.rows_flipped() {
            notes.push("row 0 is at the bottom at the bridge: rows reversed".to_owned());
        }
        let instrument = if b.instrument.is_empty() { scanner.to_owned() } else { b.instrument.clone() };
        ScanHeader {
            n_rows: b.rows,
            n_columns: b.columns,
            azimuth_start: wrap_azimuth(b.azimuth_start + b.azimuth_step * f64::from(first)),
            azimuth_step: b.azimuth_step.abs(),
            elevation_start: b.elevation_start + b.elevation_step * f64::from(top),
            elevation_step: b.elevation_step.abs(),
            seam_column: b
                .seam_column
                .map(|seam| if self.columns_flipped() { b.columns - seam } else { seam }),
            intensity_range: b.intensity,
            simulated: b.simulated,
            range_error_m: b.range_error_m.or_else(|| data_sheet_range_error_m(&instrument)),
            instrument,
            acquired_unix_s: b.acquired_unix_s,
            notes,
        }
    }

    /// Returns the number of warm-up columns at the start of each face that the host must ignore.
    pub(crate) fn warm_up_columns(&self) -> u32 {
        if self.columns_flipped() { 0 } else { self.begin.warm_up_columns }
    }

    /// Invalidates a warm-up column that the host cannot ignore, because it is last in the host's order.
    pub(crate) fn invalidate_warm_up(&self, number: u32, column: &mut Column) {
        let start = self.begin.seam_column.filter(|seam| number >= *seam).unwrap_or(0);
        if self.columns_flipped() && number - start < self.begin.warm_up_columns {
            column.state.fill(State::NoReturn);
        }
    }

    /// Decodes a column; returns its number at the bridge and the column in the host's order.
    pub(crate) fn column(&self, payload: &[u8]) -> Result<(u32, Column)> {
        let fault = |what: &str| Error::Bridge(format!("a column of {} bytes {what}", payload.len()));
        if payload.len() < FIXED {
            return Err(fault("is shorter than its fixed part"));
        }
        let [number, first_row, n_rows, face] = [0, 4, 8, 12].map(|at| u32_at(payload, at));
        let b = &self.begin;
        let end = u64::from(first_row) + u64::from(n_rows);
        if number >= b.columns || end > u64::from(b.rows) || face > 1 {
            return Err(fault("lies outside the lattice"));
        }
        let n = n_rows as usize;
        let bitmap = payload.get(FIXED..FIXED + n.div_ceil(8)).ok_or_else(|| fault("has no bitmap"))?;
        let valid = |i: usize| bitmap[i / 8] >> (7 - i % 8) & 1 == 1;
        let size = match b.values {
            Values::Range => 6,
            Values::Polar => 14,
        };
        let mut records = payload[FIXED + bitmap.len()..].chunks_exact(size);
        let set: u32 = bitmap.iter().map(|byte| byte.count_ones()).sum();
        if records.len() != set as usize
            || !records.remainder().is_empty()
            || (n..bitmap.len() * 8).any(valid)
        {
            return Err(fault("contains records that do not match its bitmap"));
        }

        let mut column = Column {
            index: if self.columns_flipped() { b.columns - 1 - number } else { number },
            face: if face == 1 { Face::Back } else { Face::Front },
            first_row: if self.rows_flipped() { b.rows - end as u32 } else { first_row },
            range_m: vec![0.0; n],
            azimuth: vec![0.0; n],
            elevation: vec![0.0; n],
            intensity: vec![0; n],
            state: vec![State::NoReturn; n],
        };
        let azimuth = b.azimuth_start + b.azimuth_step * f64::from(number);
        for i in (0..n).filter(|i| valid(*i)) {
            let record = records.next().ok_or_else(|| fault("ends early"))?;
            let range = u32_at(record, 0);
            if range == 0 {
                return Err(fault("contains a range of 0"));
            }
            let off = |at: usize| match b.values {
                Values::Range => 0.0,
                Values::Polar => f64::from(u32_at(record, at).cast_signed()) * NANORADIAN,
            };
            let elevation = b.elevation_start + b.elevation_step * f64::from(first_row + i as u32);
            let k = if self.rows_flipped() { n - 1 - i } else { i };
            column.range_m[k] = f64::from(range) * b.range_unit_m;
            column.intensity[k] = u16_at(record, 4);
            column.azimuth[k] = wrap_azimuth(azimuth + off(6));
            column.elevation[k] = elevation + off(10);
            column.state[k] = State::Valid;
        }
        Ok((number, column))
    }
}
