//! Trim lines of the result document: the lines along which the formed plate is marked for its last cut.

use serde::{Deserialize, Serialize};

use platen_model::TrimLine;
use platen_model::units::mm;
use platen_plant::PlateFile;
use platen_shape::evaluate::{self, Place};
use platen_shape::measure::Measurement;

/// Trim line on the formed plate.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TrimLineRecord {
    /// Name.
    pub name: String,
    /// Its points as in the plate file.
    pub points: Vec<TrimPointRecord>,
}

/// Point of a trim line, to be marked with a tape from both ends of the line.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct TrimPointRecord {
    /// Along u.
    pub u_mm: f64,
    /// Along v.
    pub v_mm: f64,
    /// On the scanned face, scanner frame.
    pub position_m: [f64; 3],
    /// Straight distance from the line's first point.
    pub from_first_mm: f64,
    /// Straight distance from the line's last point.
    pub from_last_mm: f64,
    /// False where the surface is interpolated across unseen area.
    pub seen: bool,
}

pub(super) fn record(measurement: &Measurement, plate: &PlateFile) -> Vec<TrimLineRecord> {
    plate.trim_lines.iter().map(|line| trim_line(measurement, line)).collect()
}

fn trim_line(measurement: &Measurement, line: &TrimLine) -> TrimLineRecord {
    let at = |[u, v]: &[f64; 2]| evaluate::place(&measurement.surface, &measurement.location, *u, *v);
    let places: Vec<Place> = line.points.iter().map(at).collect();
    let from = |end: Option<&Place>, place: &Place| {
        end.map_or(0.0, |end| mm((place.position - end.position).norm()))
    };
    let point = |place: &Place| TrimPointRecord {
        u_mm: mm(place.u),
        v_mm: mm(place.v),
        position_m: place.position.into(),
        from_first_mm: from(places.first(), place),
        from_last_mm: from(places.last(), place),
        seen: place.seen,
    };
    TrimLineRecord { name: line.name.clone(), points: places.iter().map(point).collect() }
}
