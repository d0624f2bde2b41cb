//! Errors of the extraction.

use crate::Vec3;

/// Reason why no plate was found in a scan.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum Refusal {
    /// The header describes no lattice.
    #[error(
        "the scan has {n_rows} rows, steps of {azimuth_step} rad and {elevation_step} rad: not a lattice; check the driver"
    )]
    NotALattice {
        n_rows: u32,
        /// Radians.
        azimuth_step: f64,
        /// Radians.
        elevation_step: f64,
    },
    /// The plate file gives no size.
    #[error("the plate is {width_mm} x {height_mm} mm in the plate file; both must be above zero")]
    NoSize { width_mm: f64, height_mm: f64 },
    /// No face in the scan is near the plate's size.
    #[error(
        "no plate in the scan: the largest connected face {} has {largest_m2:.2} m2, the plate {expected_m2:.2} m2; \
         check the scan window{}",
        if *.region { "in the region of interest" } else { "that ends inside the scan" },
        if *.region { " and the region of interest" } else { "" }
    )]
    NoPlate {
        /// Area of the largest face found, square metres.
        largest_m2: f64,
        /// Area of the plate, square metres.
        expected_m2: f64,
        region: bool,
    },
    /// A face of another size.
    #[error(
        "the face at ({:.1}, {:.1}, {:.1}) m measures about {:.0} x {:.0} mm, {:.0} x {:.0} mm in the plate file; \
         check the recipe",
        .at.x, .at.y, .at.z, .found_mm[0], .found_mm[1], .expected_mm[0], .expected_mm[1]
    )]
    WrongSize {
        /// Middle of the face, metres.
        at: Vec3,
        /// Longer and shorter side of the smallest rectangle around the face, millimetres.
        found_mm: [f64; 2],
        /// Longer and shorter side of the plate, millimetres.
        expected_mm: [f64; 2],
    },
    /// Several faces could be the plate.
    #[error(
        "{count} faces have the plate's size, at ({:.1}, {:.1}, {:.1}) m and at ({:.1}, {:.1}, {:.1}) m; \
         set a region of interest that holds one",
        .first.x, .first.y, .first.z, .second.x, .second.y, .second.z
    )]
    SeveralPlates {
        count: usize,
        /// Middle of one, metres.
        first: Vec3,
        /// Middle of another, metres.
        second: Vec3,
    },
    /// The lattice is too coarse for the plate's edges.
    #[error(
        "samples lie {spacing_mm:.0} mm apart on the plate, its edges and corners need {widest_mm:.0} mm or less; \
         scan with an angular step of {} degrees or less, or from nearer",
        (step_deg * 100.0).floor() / 100.0
    )]
    TooCoarse {
        /// Side of the square of the face that a sample stands for, millimetres.
        spacing_mm: f64,
        /// Widest spacing that is measured, millimetres.
        widest_mm: f64,
        step_deg: f64,
    },
    /// The region of interest cuts the plate.
    #[error(
        "the plate reaches out of the region of interest over {cut_mm:.0} mm of its edge; enlarge the region"
    )]
    CutByRegion {
        /// Length of the cut, millimetres.
        cut_mm: f64,
    },
}
