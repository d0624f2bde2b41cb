//! Stated errors: the errors of one measurement together with their stated standard deviations.

use platen_model::units::{metres, mm};
use platen_shape::evaluate::{self, Place};
use platen_shape::inspection::{Check, ShapeChecks, corners_seen, edge_doubts};
use platen_shape::measure::Measurement;
use platen_shape::outline::{Corner, EdgeCurve, Outline};
use platen_shape::{Blank, EXPANDED, RangeError, Vec3};

use crate::accuracy::Truth;

use serde_json::{Value as Json, json};

/// Error of a figure with a stated interval: kind, metres or radians, its standard deviation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stated {
    pub(super) kind: Kind,
    pub(super) error: f64,
    pub(super) sigma: f64,
}

impl Stated {
    /// Returns the error and its stated interval in the unit of the kind.
    pub(super) fn document(&self) -> Json {
        let (name, unit) = self.kind.name_and_unit();
        json!({ "of": name, "error": unit(self.error), "uncertainty": unit(EXPANDED * self.sigma) })
    }
}

/// Kinds of figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Across the edges, of corners.
    Corner,
    /// Along u and v, of markers.
    Marker,
    /// Along the normal, of markers.
    Normal,
    Edge,
    Diagonal,
    Angle,
    Twist,
    /// Largest gap of a template.
    Gap,
    /// Figures of stations.
    StationGap,
    StationDeviation,
    StationDeficit,
}

/// All kinds, in the order of the table.
pub(super) const KINDS: [Kind; 11] = [
    Kind::Corner,
    Kind::Marker,
    Kind::Normal,
    Kind::Edge,
    Kind::Diagonal,
    Kind::Angle,
    Kind::Twist,
    Kind::Gap,
    Kind::StationGap,
    Kind::StationDeviation,
    Kind::StationDeficit,
];

impl Kind {
    /// Returns name and unit in tables and documents.
    pub(super) fn name_and_unit(self) -> (&'static str, fn(f64) -> f64) {
        match self {
            Self::Corner => ("corner, u or v, mm", mm),
            Self::Marker => ("marker, u or v, mm", mm),
            Self::Normal => ("marker, normal, mm", mm),
            Self::Edge => ("edge, mm", mm),
            Self::Diagonal => ("diagonal, mm", mm),
            Self::Angle => ("angle, degrees", f64::to_degrees),
            Self::Twist => ("twist, degrees", f64::to_degrees),
            Self::Gap => ("template gap, mm", mm),
            Self::StationGap => ("station, gap, mm", mm),
            Self::StationDeviation => ("station, deviation, mm", mm),
            Self::StationDeficit => ("station, deficit, 1/m", |per_m| per_m),
        }
    }
}

/// Errors of a measurement.
pub(super) struct Errors {
    pub(super) stated: Vec<Stated>,
    /// Largest distance of a corner and of a marker.
    pub(super) corner: f64,
    pub(super) marker: f64,
    pub(super) corners_seen: [bool; 4],
}

/// Errors beyond these are listed: metres.
const GROSS_CORNER: f64 = 2e-3;
const GROSS_MARKER: f64 = 1e-3;

impl Errors {
    /// Compares positions and dimension checks with the truth.
    pub(super) fn of(
        measurement: &Measurement,
        outline: &Outline,
        truth: &Truth,
        face_inset: f64,
        range_error: RangeError,
    ) -> Self {
        let surface = &measurement.surface;
        let location = measurement.location.clone().with_range_error(range_error);
        let mut stated = Vec::new();
        let mut distance = |kind: Kind, [u, v]: [f64; 2], at: Vec3, corner: Option<&Corner>| {
            let Place { position, sigma, .. } = evaluate::place(surface, &location, u, v);
            let (off, derivatives) = (position - at, surface.derivatives(u, v));
            let axes = [derivatives.u.normalize(), derivatives.v.normalize()];
            let of_corner = |corner: &Corner| {
                let [of_u, of_v] = corner_sigma(corner, [u, v]);
                let moved = axes.map(|axis| range_error.along(&position, &axis));
                [of_u.hypot(moved[0]), of_v.hypot(moved[1]), sigma[2]]
            };
            let sigma = corner.map_or(sigma, of_corner);
            for (axis, sigma) in axes.iter().zip(sigma) {
                stated.push(Stated { kind, error: off.dot(axis), sigma });
            }
            if kind == Kind::Marker {
                stated.push(Stated {
                    kind: Kind::Normal,
                    error: off.dot(&derivatives.normal()),
                    sigma: sigma[2],
                });
            }
            off.norm()
        };
        let (w, h) = (surface.width(), surface.height());
        let places = [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]];
        let corners = places.iter().zip(&truth.corners_m).zip(&outline.corners);
        let corner =
            corners.map(|((uv, p), corner)| distance(Kind::Corner, *uv, Vec3::from(*p), Some(corner)));
        let corner = corner.fold(0.0, f64::max);
        let marker = truth
            .markers
            .iter()
            .map(|m| distance(Kind::Marker, [metres(m.u_mm), metres(m.v_mm)], Vec3::from(m.position_m), None))
            .fold(0.0, f64::max);
        let found = ShapeChecks::new(outline, surface, range_error);
        let known = ShapeChecks::of_outline(&true_outline(outline, truth), surface, range_error);
        let mut checks = |kind: Kind, found: &[Check], known: &[Check]| {
            stated.extend(found.iter().zip(known).map(|(found, known)| Stated {
                kind,
                error: found.value - known.value,
                sigma: found.sigma,
            }));
        };
        let edges = |checks: &ShapeChecks| checks.edges.map(|edge| edge.mid);
        checks(Kind::Edge, &edges(&found), &edges(&known));
        checks(Kind::Diagonal, &found.diagonals, &known.diagonals);
        checks(Kind::Angle, &found.angles, &known.angles);
        checks(Kind::Twist, &found.twist, &known.twist);
        let doubts = edge_doubts(&found, surface, Blank::rectangle(w, h).face_edge_lengths(face_inset));
        Self { stated, corner, marker, corners_seen: corners_seen(outline, &doubts) }
    }

    /// Returns whether a corner or a marker is farther off than is acceptable.
    pub(super) fn is_gross(&self) -> bool {
        self.corner > GROSS_CORNER || self.marker > GROSS_MARKER
    }
}

/// Returns the standard deviations of a corner along u and v; the outline states them along the leaving and the
/// arriving edge.
fn corner_sigma(corner: &Corner, [u, v]: [f64; 2]) -> [f64; 2] {
    let [leaving, arriving] = corner.sigma;
    // u runs along the edge that leaves the corners (0, 0) and (W, H).
    if (u > 0.0) == (v > 0.0) { [leaving, arriving] } else { [arriving, leaving] }
}

/// Returns the true outline; the smoothed face of the measured outline replaces the true one, since no figure uses it.
fn true_outline(outline: &Outline, truth: &Truth) -> Outline {
    let edges = truth.edges.each_ref().map(|edge| {
        let points: Vec<Vec3> = edge.iter().map(|p| Vec3::from(*p)).collect();
        EdgeCurve { seen: vec![true; points.len()], points, sigma: 0.0 }
    });
    let corners = edges.each_ref().map(|edge| Corner {
        point: edge.points[0],
        sigma: [0.0; 2],
        contrast: [0.0; 2],
        seen: true,
    });
    Outline { corners, edges, height_field: outline.height_field.clone() }
}
