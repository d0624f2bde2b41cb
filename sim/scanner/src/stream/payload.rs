//! Binary payload of a Column frame, section 5 of the protocol document.

use crate::column::{SimColumn, SimState};

use super::message::{ScanLayout, Values};

/// Bytes before the bitmap.
pub(super) const FIXED: usize = 24;

/// Offset of the device time, nanoseconds.
const TIME: usize = 16;

/// Encodes a column. `number` is its index at the bridge, `time_s` the device time of its first sample. Rows before
/// the first echo and after the last are omitted.
pub fn column_payload(column: &SimColumn, number: u32, begin: &ScanLayout, time_s: f64) -> Vec<u8> {
    let valid = |row: &usize| column.state[*row] == SimState::Valid;
    let rows = 0..column.state.len();
    let first = rows.clone().find(valid).unwrap_or(0);
    let end = rows.rev().find(valid).map_or(first, |last| last + 1);
    let mut bytes = Vec::with_capacity(FIXED + 15 * (end - first));
    for word in [number, first as u32, (end - first) as u32, u32::from(column.back_face)] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(((time_s * 1e9) as u64).to_le_bytes());
    for eight in (first..end).collect::<Vec<_>>().chunks(8) {
        let bits = eight.iter().enumerate().filter(|(_, row)| valid(row));
        bytes.push(bits.fold(0, |byte, (k, _)| byte | 0x80 >> k));
    }
    for row in (first..end).filter(valid) {
        let units = f64::from(column.range_m[row]) / begin.range_unit_m;
        bytes.extend((units.round() as u32).max(1).to_le_bytes());
        bytes.extend(column.intensity[row].to_le_bytes());
        if begin.values == Values::Polar {
            let even = [
                begin.azimuth_start + begin.azimuth_step * f64::from(number),
                begin.elevation_start + begin.elevation_step * row as f64,
            ];
            for (angle, even) in [column.azimuth[row], column.elevation[row]].into_iter().zip(even) {
                bytes.extend((((angle - even) * 1e9).round() as i32).to_le_bytes());
            }
        }
    }
    bytes
}

/// Returns the device time of a column's first sample, seconds.
pub(super) fn time_s(payload: &[u8]) -> f64 {
    match payload.get(TIME..FIXED).and_then(|bytes| <[u8; 8]>::try_from(bytes).ok()) {
        Some(bytes) => u64::from_le_bytes(bytes) as f64 * 1e-9,
        None => 0.0,
    }
}

/// Returns the column's number.
pub(super) fn number(payload: &[u8]) -> Option<u32> {
    let bytes = payload.get(..4)?.try_into().ok()?;
    Some(u32::from_le_bytes(bytes))
}

/// Returns the number of records in the payload, counted in its bitmap.
pub(super) fn points(payload: &[u8]) -> u64 {
    let rows = payload.get(8..12).and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes);
    let bitmap = payload.get(FIXED..FIXED + (rows as usize).div_ceil(8)).unwrap_or(&[]);
    bitmap.iter().map(|byte| u64::from(byte.count_ones())).sum()
}

/// Sets the device time to 0, as after a loss of the clock's battery.
pub(super) fn set_clock_back(payload: &mut [u8]) {
    if let Some(bytes) = payload.get_mut(TIME..FIXED) {
        bytes.fill(0);
    }
}
