//! Conversion between the internal units and those shown to people: the only place where a length becomes millimetres.

/// Converts metres to millimetres.
#[must_use]
pub fn mm(metres: f64) -> f64 {
    metres * 1000.0
}

/// Converts a place on the plate from metres to millimetres.
#[must_use]
pub fn mm_pair(place: [f64; 2]) -> [f64; 2] {
    place.map(mm)
}

/// Converts millimetres, as given by a person, to metres.
#[must_use]
pub fn metres(mm: f64) -> f64 {
    mm / 1000.0
}

/// Returns how values in a unit of a comparison's findings are printed: the suffix of their name, and their factor.
#[must_use]
pub fn readable(unit: &str) -> (&'static str, f64) {
    match unit {
        "m" => ("_mm", 1000.0),
        "rad" => ("_deg", 1.0_f64.to_degrees()),
        "1/m" => ("_per_m", 1.0),
        "1/m2" => ("_per_m2", 1.0),
        _ => ("", 1.0),
    }
}
