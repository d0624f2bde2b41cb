//! From the units inside to those that people read: the only place where a length becomes millimetres.

/// Metres to millimetres.
pub(crate) fn mm(metres: f64) -> f64 {
    metres * 1000.0
}

/// A place on the plate, metres to millimetres.
pub(crate) fn mm_pair(place: [f64; 2]) -> [f64; 2] {
    place.map(mm)
}

/// Millimetres, as a person gave them, to metres.
pub(crate) fn metres(mm: f64) -> f64 {
    mm / 1000.0
}

/// How values in a unit of a comparison's findings are read: the ending of their name, and what they are multiplied by.
pub(crate) fn readable(unit: &str) -> (&'static str, f64) {
    match unit {
        "m" => ("_mm", 1000.0),
        "rad" => ("_deg", 1.0_f64.to_degrees()),
        "1/m" => ("_per_m", 1.0),
        "1/m2" => ("_per_m2", 1.0),
        _ => ("", 1.0),
    }
}
