//! Bridge in memory for tests, written from the protocol document and not from the driver.

use platen_scan::{Column, Lattice, ScanEnd, State};
use serde_json::{Value, json};

use crate::error::Error;
use crate::message::Settings;
use crate::session::{Action, Request, Session};
use crate::wire::{Frame, kind};

pub(super) const SCAN: u32 = 41;

/// Scan kept by the bridge.
#[derive(Clone)]
pub(super) struct Bridge {
    pub(super) rows: u32,
    pub(super) columns: u32,
    pub(super) azimuth_step: f64,
    pub(super) elevation_step: f64,
    pub(super) polar: bool,
}

pub(super) const BRIDGE: Bridge =
    Bridge { rows: 21, columns: 13, azimuth_step: -0.01, elevation_step: 0.02, polar: true };

/// Returns true for a cell without measurement; column 5 is empty.
pub(super) fn missing(row: u32, column: u32) -> bool {
    (row + 3 * column).is_multiple_of(4) || column == 5
}

/// Returns range in units, intensity, and angular deviations in nanoradians.
pub(super) fn record(row: u32, column: u32) -> (u32, u16, i32, i32) {
    (5_000_000 + 1000 * row + column, (row * 10) as u16, 1000 * row as i32 - 7000, -500 * column as i32)
}

impl Bridge {
    pub(super) fn begin(&self) -> Value {
        json!({
            "job": "job", "rows": self.rows, "columns": self.columns, "azimuth_start": 3.1,
            "azimuth_step": self.azimuth_step, "elevation_start": 0.1, "elevation_step": self.elevation_step,
            "values": if self.polar { "polar" } else { "range" }, "range_unit_m": 1e-6, "intensity": [0, 2047],
            "seam_column": null, "warm_up_columns": 3, "order": "azimuth", "something_new": [1, 2], "altered": ["rate lowered"],
        })
    }

    pub(super) fn column(&self, column: u32) -> Vec<u8> {
        let first_row = 2;
        let rows: Vec<u32> = (first_row..self.rows).collect();
        let mut payload = Vec::new();
        for number in [column, first_row, rows.len() as u32, 0] {
            payload.extend(number.to_le_bytes());
        }
        payload.extend(99_u64.to_le_bytes());
        for eight in rows.chunks(8) {
            let bit = |(k, row): (usize, &u32)| if missing(*row, column) { 0 } else { 0x80_u8 >> k };
            payload.push(eight.iter().enumerate().map(bit).sum());
        }
        for row in rows.into_iter().filter(|row| !missing(*row, column)) {
            let (range, intensity, azimuth, elevation) = record(row, column);
            payload.extend(range.to_le_bytes());
            payload.extend(intensity.to_le_bytes());
            if self.polar {
                payload.extend(azimuth.to_le_bytes());
                payload.extend(elevation.to_le_bytes());
            }
        }
        payload
    }

    pub(super) fn points(&self) -> u64 {
        let cells = (0..self.columns).flat_map(|column| (2..self.rows).map(move |row| (row, column)));
        cells.filter(|(row, column)| !missing(*row, *column)).count() as u64
    }

    pub(super) fn end(&self) -> Value {
        let crcs: Vec<u8> =
            (0..self.columns).flat_map(|c| crc32c::crc32c(&self.column(c)).to_le_bytes()).collect();
        json!({
            "outcome": "complete", "columns": self.columns, "points": self.points(),
            "digest": crc32c::crc32c(&crcs),
        })
    }

    /// Returns the bridge's answer to a frame.
    pub(super) fn answer(&self, kind: u16, payload: &[u8]) -> Vec<Frame> {
        let asked: Value = serde_json::from_slice(payload).unwrap();
        let scan = |columns: Vec<u32>| {
            let mut frames = vec![text(kind::SCAN_BEGIN, SCAN, &self.begin())];
            frames.extend(columns.into_iter().map(|c| frame(kind::COLUMN, SCAN, self.column(c))));
            frames.push(text(kind::SCAN_END, SCAN, &self.end()));
            frames
        };
        match kind {
            kind::HELLO => {
                assert_eq!(asked["versions"], json!([[1, 0], [1, 0]]));
                let capabilities =
                    json!({"version": [1, 0], "model": "Test", "serial": "S1", "live": false, "modes": []});
                vec![text(kind::CAPABILITIES, 0, &capabilities)]
            }
            kind::START => {
                assert_eq!(asked, json!({"job": "job", "divisor": 4, "rate_kpts": 244, "compression": 1}));
                let status = json!({"state": "scanning", "progress": 0.5, "time_ns": 1});
                [vec![text(kind::STATUS, 0, &status)], scan((0..self.columns).collect())].concat()
            }
            kind::RESUME => {
                let runs: Vec<(u32, u32)> = serde_json::from_value(asked["missing"].clone()).unwrap();
                scan(runs.into_iter().flat_map(|(first, last)| first..=last).collect())
            }
            other => panic!("the driver sent {other:#06x}"),
        }
    }
}

pub(super) fn frame(kind: u16, scan: u32, payload: Vec<u8>) -> Frame {
    let crc = crc32c::crc32c(&payload);
    Frame { kind, scan, payload, crc }
}

pub(super) fn text(kind: u16, scan: u32, value: &Value) -> Frame {
    frame(kind, scan, serde_json::to_vec(value).unwrap())
}

pub(super) fn request() -> Request {
    Request {
        client: "test".to_owned(),
        job: "job".to_owned(),
        settings: Settings { divisor: 4, rate_kpts: 244, compression: 1, window: None },
        serial: None,
    }
}

/// Scan received by the host.
#[derive(Debug)]
pub(super) struct Got {
    pub(super) lattice: Lattice,
    pub(super) columns: Vec<Column>,
    pub(super) end: ScanEnd,
    pub(super) connections: usize,
}

/// Runs a session to its end. `spoil` receives the number of the connection and the frames that answer one request, and
/// returns the frames that arrive; the connection breaks at a `None`.
pub(super) fn run(
    bridge: &Bridge,
    mut spoil: impl FnMut(usize, Vec<Frame>) -> Vec<Option<Frame>>,
) -> Result<Got, Error> {
    let mut session = Session::new(request());
    let (mut header, mut columns) = (None, Vec::<Column>::new());
    for connection in 1..=50 {
        session.connected();
        let mut arriving = std::collections::VecDeque::new();
        'connection: loop {
            while let Some(action) = session.action() {
                match action {
                    Action::Send(kind, _, payload) => {
                        arriving.extend(spoil(connection, bridge.answer(kind, &payload)));
                    }
                    Action::Progress(..) => {}
                    Action::Begin(begin) => assert!(header.replace(begin).is_none(), "begun twice"),
                    Action::Column(column) => {
                        assert!(
                            columns.iter().all(|c| c.index != column.index),
                            "column {} twice",
                            column.index
                        );
                        columns.push(*column);
                    }
                    Action::End(end) => {
                        let mut lattice = Lattice::new(*header.unwrap());
                        columns.iter().for_each(|column| lattice.push(column).unwrap());
                        return Ok(Got { lattice, columns, end, connections: connection });
                    }
                }
            }
            match arriving.pop_front() {
                Some(Some(frame)) => match session.frame(&frame) {
                    Err(Error::Broken(_) | Error::Busy { .. }) => break 'connection,
                    other => other?,
                },
                Some(None) | None => break 'connection,
            }
        }
    }
    Err(Error::TooLate("50 connections".to_owned()))
}

/// Asserts that every cell is at the place where the bridge measured it.
#[track_caller]
pub(super) fn check(bridge: &Bridge, got: &Got) {
    let lattice = &got.lattice;
    assert_eq!(got.columns.len() as u32, bridge.columns);
    // Where columns run clockwise, warm-up columns are last in the host's order and are delivered empty.
    let clockwise = bridge.azimuth_step < 0.0;
    let empty = |column: u32| clockwise && column < 3;
    let seen = |row: u32, column: u32| row >= 2 && !missing(row, column) && !empty(column);
    let cells = (0..bridge.columns).flat_map(|column| (0..bridge.rows).map(move |row| (row, column)));
    let points = cells.filter(|(row, column)| seen(*row, *column)).count() as u64;
    let warm_up = if clockwise { 0 } else { 3 };
    assert_eq!((got.end.columns, got.end.points, got.end.warm_up_columns), (bridge.columns, points, warm_up));
    for column in 0..bridge.columns {
        for row in 0..bridge.rows {
            let c = if clockwise { bridge.columns - 1 - column } else { column };
            let r = if bridge.elevation_step > 0.0 { bridge.rows - 1 - row } else { row };
            let cell = lattice.cell(c as usize, r as usize);
            if !seen(row, column) {
                assert_eq!(lattice.state(cell), State::NoReturn, "({row}, {column})");
                continue;
            }
            let (range, intensity, off_az, off_el) = record(row, column);
            let (off_az, off_el) = if bridge.polar { (off_az, off_el) } else { (0, 0) };
            let azimuth = 3.1 + bridge.azimuth_step * f64::from(column) + 1e-9 * f64::from(off_az);
            let elevation = 0.1 + bridge.elevation_step * f64::from(row) + 1e-9 * f64::from(off_el);
            let seen = lattice.direction(cell).unwrap();
            assert!(platen_scan::wrap_azimuth(seen.azimuth - azimuth).abs() < 2e-9, "({row}, {column})");
            assert!((seen.elevation - elevation).abs() < 2e-9, "({row}, {column})");
            assert!((lattice.range(cell).unwrap() - f64::from(range) * 1e-6).abs() < 5e-7);
            assert_eq!(lattice.intensity(cell), intensity);
        }
    }
}
