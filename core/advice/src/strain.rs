//! Strain of the face of a plate under its bends.
//!
//! In: the angle of the bends at one place, radians; thickness t and punch radius r, metres. Out: the strain of the
//! face.
//!
//! A bend by three points is sharp, and the fitted surface rounds it off over its spans: the width of a bend in the
//! scan does not determine the strain. Under the punch the bend extends over about the thickness t, and over the arc on
//! which the plate lies on the punch. A bend of angle a is therefore about t + r a wide, its curvature is a / (t + r
//! a), and the strain of its face t / 2 times that. This is between the mean over a thickness and the cusp of the
//! simulator's fibre model (`core/bench`). Bends nearer to each other than the thickness strain the same face.
//!
//! Limit: a plate that lies on a wide punch from the first touch, or one that was rolled, is strained less than
//! computed here.

/// Returns the strain of the face under bends of this total angle, radians, at one place.
#[must_use]
pub fn face_strain(thickness: f64, punch_radius: f64, angle: f64) -> f64 {
    0.5 * thickness * angle / (thickness + punch_radius * angle)
}

/// Returns the total angle that strains the face to a given strain, radians; infinite where the punch is too round for
/// that.
#[must_use]
pub fn angle_of_strain(thickness: f64, punch_radius: f64, strain: f64) -> f64 {
    let rest = 0.5 * thickness - strain * punch_radius;
    if rest > 0.0 { strain * thickness / rest } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angle_of_a_strain_has_that_strain() {
        for radius in [0.0, 0.025, 0.2] {
            let angle = angle_of_strain(0.036, radius, 0.05);
            assert!((face_strain(0.036, radius, angle) - 0.05).abs() < 1e-12, "{radius}");
        }
        assert_eq!(angle_of_strain(0.036, 0.4, 0.05), f64::INFINITY);
        // From the study of thick plates: 1.5 and 2.1 % at 31 and 43 mrad.
        assert!((face_strain(0.036, 0.0, 0.031) - 0.015).abs() < 1e-3);
        assert!((face_strain(0.036, 0.0, 0.043) - 0.021).abs() < 1e-3);
    }
}
