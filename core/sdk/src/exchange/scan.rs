//! Scans: header, columns, end, and the requested window.

use std::ffi::CStr;

use platen_abi::payload::{self, Header};
use platen_scan::{Column, Face, Outcome, ScanEnd, ScanHeader, State, Window, wrap_azimuth};

use super::{Arrays, DecodeError, Payload};

/// Azimuths may be counted over two turns, not more, radians.
const MOST_AZIMUTH: f64 = 4.0 * std::f64::consts::PI;

impl Payload for ScanHeader {
    const FORMAT: &'static CStr = payload::Scan::FORMAT;

    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
        let notes = self.notes.join("\n");
        let mut arrays = Arrays::behind::<payload::Scan>();
        let head = payload::Scan {
            struct_size: size_of::<payload::Scan>() as u32,
            flags: u32::from(self.simulated) | (u32::from(self.range_error_m.is_some()) << 1),
            n_rows: self.n_rows,
            n_columns: self.n_columns,
            azimuth_start: self.azimuth_start,
            azimuth_step: self.azimuth_step,
            elevation_start: self.elevation_start,
            elevation_step: self.elevation_step,
            seam_column: self.seam_column.unwrap_or(u32::MAX),
            intensity_min: self.intensity_range.0,
            intensity_max: self.intensity_range.1,
            acquired_unix_s: self.acquired_unix_s.unwrap_or(0.0),
            instrument: arrays.add(self.instrument.as_bytes()),
            notes: arrays.add(notes.as_bytes()),
            range_error_m: self.range_error_m.unwrap_or(0.0),
        };
        arrays.encode(&head, allocate)
    }

    fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let head: payload::Scan = payload::read(bytes)?;
        let range_error_m = (head.flags & 2 != 0).then_some(head.range_error_m);
        if let Some(error) = range_error_m.filter(|error| !(error.is_finite() && *error >= 0.0)) {
            return Err(DecodeError::Invalid(format!("range_error_m is {error}, must be at least 0")));
        }
        Ok(Self {
            n_rows: head.n_rows,
            n_columns: head.n_columns,
            azimuth_start: head.azimuth_start,
            azimuth_step: head.azimuth_step,
            elevation_start: head.elevation_start,
            elevation_step: head.elevation_step,
            seam_column: (head.seam_column != u32::MAX).then_some(head.seam_column),
            intensity_range: (head.intensity_min, head.intensity_max),
            simulated: head.flags & 1 != 0,
            instrument: payload::text(bytes, head.instrument)?,
            acquired_unix_s: (head.acquired_unix_s != 0.0).then_some(head.acquired_unix_s),
            range_error_m,
            notes: payload::text(bytes, head.notes)?.lines().map(str::to_owned).collect(),
        })
    }
}

impl Payload for Column {
    const FORMAT: &'static CStr = payload::Column::FORMAT;

    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
        let state: Vec<u8> = self.state.iter().map(|s| *s as u8).collect();
        let mut arrays = Arrays::behind::<payload::Column>();
        let head = payload::Column {
            struct_size: size_of::<payload::Column>() as u32,
            index: self.index,
            face: u32::from(self.face == Face::Back),
            first_row: self.first_row,
            range_m: arrays.add(&self.range_m),
            azimuth: arrays.add(&self.azimuth),
            elevation: arrays.add(&self.elevation),
            intensity: arrays.add(&self.intensity),
            state: arrays.add(&state),
        };
        arrays.encode(&head, allocate)
    }

    fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let head: payload::Column = payload::read(bytes)?;
        let states = payload::slice::<u8>(bytes, head.state)?;
        if let Some(code) = states.iter().find(|code| **code > 2) {
            return Err(DecodeError::Invalid(format!(
                "state {code} in column {}, must be 0, 1 or 2",
                head.index
            )));
        }
        let state = |code: &u8| match code {
            0 => State::Valid,
            1 => State::DirectionOnly,
            _ => State::NoReturn,
        };
        let face = match head.face {
            0 => Face::Front,
            1 => Face::Back,
            other => {
                let index = head.index;
                return Err(DecodeError::Invalid(format!("face {other} of column {index}, must be 0 or 1")));
            }
        };
        let azimuth = payload::slice::<f64>(bytes, head.azimuth)?;
        if let Some(beyond) = azimuth.iter().find(|azimuth| azimuth.abs() > MOST_AZIMUTH) {
            return Err(DecodeError::Invalid(format!("azimuth {beyond} rad in column {}", head.index)));
        }
        Ok(Self {
            index: head.index,
            face,
            first_row: head.first_row,
            range_m: payload::slice::<f64>(bytes, head.range_m)?.to_vec(),
            azimuth: azimuth.iter().map(|a| wrap_azimuth(*a)).collect(),
            elevation: payload::slice::<f64>(bytes, head.elevation)?.to_vec(),
            intensity: payload::slice::<u16>(bytes, head.intensity)?.to_vec(),
            state: states.iter().map(state).collect(),
        })
    }
}

impl Payload for ScanEnd {
    const FORMAT: &'static CStr = payload::ScanEnd::FORMAT;

    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
        let head = payload::ScanEnd {
            struct_size: size_of::<payload::ScanEnd>() as u32,
            columns: self.columns,
            points: self.points,
            warm_up_columns: self.warm_up_columns,
            outcome: match self.outcome {
                Outcome::Complete => 0,
                Outcome::Aborted => 1,
                Outcome::Failed => 2,
            },
        };
        Arrays::behind::<payload::ScanEnd>().encode(&head, allocate)
    }

    fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let head: payload::ScanEnd = payload::read(bytes)?;
        Ok(Self {
            columns: head.columns,
            points: head.points,
            warm_up_columns: head.warm_up_columns,
            outcome: match head.outcome {
                0 => Outcome::Complete,
                1 => Outcome::Aborted,
                2 => Outcome::Failed,
                other => return Err(DecodeError::Invalid(format!("outcome {other}, must be 0, 1 or 2"))),
            },
        })
    }
}

/// Returns the window in the form of the boundary, also for the argument of `estimate`.
#[must_use]
pub fn to_raw_window(window: &Window) -> payload::Window {
    payload::Window {
        struct_size: size_of::<payload::Window>() as u32,
        reserved: 0,
        azimuth_start: window.azimuth_start,
        azimuth_width: window.azimuth_width,
        elevation_min: window.elevation_min,
        elevation_max: window.elevation_max,
    }
}

/// Returns the window from such an argument.
#[must_use]
pub fn from_raw_window(window: &payload::Window) -> Window {
    Window {
        azimuth_start: window.azimuth_start,
        azimuth_width: window.azimuth_width,
        elevation_min: window.elevation_min,
        elevation_max: window.elevation_max,
    }
}

impl Payload for Window {
    const FORMAT: &'static CStr = payload::Window::FORMAT;

    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
        Arrays::behind::<payload::Window>().encode(&to_raw_window(self), allocate)
    }

    fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        Ok(from_raw_window(&payload::read(bytes)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_of_a_scan_is_read_as_it_was_written() {
        let header = ScanHeader {
            n_rows: 7,
            n_columns: 9,
            azimuth_start: 0.1,
            azimuth_step: 0.002,
            elevation_start: -0.5,
            elevation_step: 0.001,
            seam_column: None,
            intensity_range: (3, 900),
            simulated: true,
            instrument: "maker model 7".into(),
            acquired_unix_s: Some(1.7e9),
            range_error_m: Some(0.002),
            notes: vec!["rows reversed".into(), "units: mm".into()],
        };
        assert_eq!(ScanHeader::decode(header.to_buffer().as_ref()), Ok(header.clone()));
        // Written by a driver that was built before the range error was appended.
        let mut older = header.to_buffer();
        older.as_mut()[..4].copy_from_slice(&96_u32.to_le_bytes());
        older.as_mut()[4] &= !2;
        let unknown = ScanHeader { range_error_m: None, ..header };
        assert_eq!(ScanHeader::decode(older.as_ref()), Ok(unknown.clone()));
        older.as_mut()[..4].copy_from_slice(&88_u32.to_le_bytes());
        assert!(ScanHeader::decode(older.as_ref()).is_err());
        let stated = |error| ScanHeader { range_error_m: Some(error), ..unknown.clone() };
        assert!(
            [f64::NAN, -1.0].iter().all(|e| ScanHeader::decode(stated(*e).to_buffer().as_ref()).is_err())
        );
        let column = Column {
            index: 4,
            face: Face::Back,
            first_row: 2,
            range_m: vec![1.5, 0.0],
            azimuth: vec![0.25, 0.26],
            elevation: vec![0.1, 0.2],
            intensity: vec![17, 0],
            state: vec![State::Valid, State::NoReturn],
        };
        assert_eq!(Column::decode(column.to_buffer().as_ref()), Ok(column));
        let end = ScanEnd { columns: 9, points: 61, warm_up_columns: 2, outcome: Outcome::Complete };
        assert_eq!(ScanEnd::decode(end.to_buffer().as_ref()), Ok(end));
        let window =
            Window { azimuth_start: -1.0, azimuth_width: 2.0, elevation_min: -0.75, elevation_max: 0.25 };
        assert_eq!(Window::decode(window.to_buffer().as_ref()), Ok(window));
    }
}
