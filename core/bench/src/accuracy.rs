//! Errors of a measurement against the true shape of a simulated plate.
//!
//! The truth is the document that the simulated scanner writes beside a scan (driver option `truth_file`,
//! `platen-sim scanner --truth`). It does not depend on the measurement, and the measurement does not read it.

use std::path::Path;

use platen_model::units::metres;
use platen_shape::measure::Measurement;
use platen_shape::{Surface, Vec3};

use serde::Deserialize;

/// Width of the strip along the edges whose surface errors are counted separately, metres.
pub const EDGE_STRIP: f64 = 0.1;
/// Width of the strip along the edges whose curvature errors are not counted, metres.
pub const CURVATURE_STRIP: f64 = 0.15;
/// Newton steps of the projection of a point onto the face, from a start point within millimetres.
const FOOT_STEPS: usize = 3;

/// True shape of a plate; metres, scanner frame.
#[derive(Debug, Clone, Deserialize)]
pub struct Truth {
    /// Corners (0,0), (W,0), (W,H), (0,H) of the scanned face.
    pub corners_m: [[f64; 3]; 4],
    /// Edges v = 0, u = W, v = H, u = 0 of the scanned face, counter-clockwise; on a bevelled plate they lie inside the
    /// rectangle.
    pub edges: [Vec<[f64; 3]>; 4],
    /// Markers on the scanned face.
    pub markers: Vec<TrueMarker>,
    /// Positions and curvatures at a few hundred points.
    pub grid: TrueGrid,
    /// Positions, at most 50 mm apart.
    pub face: TrueFace,
}

/// Marker with its true position.
#[derive(Debug, Clone, Deserialize)]
pub struct TrueMarker {
    /// Along u.
    pub u_mm: f64,
    /// Along v.
    pub v_mm: f64,
    /// On the scanned face.
    pub position_m: [f64; 3],
}

/// Regular grid over the plate, edges included, v outer, u inner.
#[derive(Debug, Clone, Deserialize)]
pub struct TrueGrid {
    /// Points along u.
    pub nu: usize,
    /// Points along v.
    pub nv: usize,
    /// On the scanned face.
    pub position_m: Vec<[f64; 3]>,
    /// Curvature along u of the mid-surface.
    pub kappa_u_per_m: Vec<f64>,
    /// Curvature along v.
    pub kappa_v_per_m: Vec<f64>,
}

/// Regular grid like [`TrueGrid`], positions only.
#[derive(Debug, Clone, Deserialize)]
pub struct TrueFace {
    /// Points along u.
    pub nu: usize,
    /// Points along v.
    pub nv: usize,
    /// On the scanned face.
    pub position_m: Vec<[f64; 3]>,
}

/// Failure to read a truth file.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum TruthError {
    /// Unreadable file.
    #[error("{path}: {source}; the simulated scanner writes it when its option truth_file is set")]
    Read { path: String, source: std::io::Error },
    /// File that is not a truth document.
    #[error(
        "{path}: not the truth of a scan: {what}; rebuild the simulated driver together with this program"
    )]
    Malformed { path: String, what: String },
}

impl Truth {
    /// Reads a truth file.
    ///
    /// # Errors
    /// [`TruthError`].
    pub fn read(file: &Path) -> Result<Self, TruthError> {
        let path = file.display().to_string();
        let text = std::fs::read(file).map_err(|source| TruthError::Read { path: path.clone(), source })?;
        let malformed = |what: String| TruthError::Malformed { path: path.clone(), what };
        let truth: Self = serde_json::from_slice(&text).map_err(|e| malformed(e.to_string()))?;
        let (grid, face) = (&truth.grid, &truth.face);
        let fits = |nu: usize, nv: usize, found: usize| nu.min(nv) >= 2 && nu.checked_mul(nv) == Some(found);
        let sound = fits(face.nu, face.nv, face.position_m.len())
            && [grid.position_m.len(), grid.kappa_u_per_m.len(), grid.kappa_v_per_m.len()]
                .into_iter()
                .all(|found| fits(grid.nu, grid.nv, found));
        if sound { Ok(truth) } else { Err(malformed("a grid does not fit its size".into())) }
    }
}

/// Errors of one measurement; metres, radians, 1/m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// Root mean square of the distances of the corners.
    pub corners: f64,
    /// Mean distance of the markers.
    pub markers_mean: f64,
    /// Largest distance of a marker.
    pub markers_worst: f64,
    /// Root mean square distance of the true face from the measured one along its normal, outside of [`EDGE_STRIP`].
    pub surface_inside: f64,
    /// The same inside of [`EDGE_STRIP`].
    pub surface_edge: f64,
    /// Sides along u of the cells of a lattice drawn on the plate (21 x 21 points): measured minus true, root mean
    /// square about zero, so that a bias is included.
    pub side_u: f64,
    /// Sides along v.
    pub side_v: f64,
    /// Angles of the same cells.
    pub angle: f64,
    /// Curvatures along u and v, root mean square, without [`CURVATURE_STRIP`].
    pub curvature: f64,
}

impl Accuracy {
    /// Compares a measurement with the truth.
    #[must_use]
    pub fn of(measurement: &Measurement, truth: &Truth) -> Self {
        let surface = &measurement.surface;
        let corners = measurement
            .corners
            .iter()
            .zip(&truth.corners_m)
            .map(|(found, p)| (found - Vec3::from(*p)).norm());
        let markers: Vec<f64> = truth
            .markers
            .iter()
            .map(|m| (surface.face(metres(m.u_mm), metres(m.v_mm)) - Vec3::from(m.position_m)).norm())
            .collect();
        let (inside, edge) = heights(surface, &truth.face);
        let cells = Cells::of(surface, &truth.grid);
        Self {
            corners: rms(corners),
            markers_mean: markers.iter().sum::<f64>() / markers.len().max(1) as f64,
            markers_worst: markers.iter().copied().fold(0.0, f64::max),
            surface_inside: rms(inside),
            surface_edge: rms(edge),
            side_u: rms(cells.side_u),
            side_v: rms(cells.side_v),
            angle: rms(cells.angle),
            curvature: rms(curvature(surface, &truth.grid)),
        }
    }
}

/// Returns the root mean square; 0 without values.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (n, sum) = values.into_iter().fold((0_usize, 0.0), |(n, sum), x| (n + 1, sum + x * x));
    (sum / n.max(1) as f64).sqrt()
}

/// Returns (u, v) of the k-th node of a regular grid over the plate.
fn place(surface: &Surface, k: usize, [nu, nv]: [usize; 2]) -> [f64; 2] {
    [
        surface.width() * (k % nu) as f64 / (nu - 1) as f64,
        surface.height() * (k / nu) as f64 / (nv - 1) as f64,
    ]
}

fn from_edge(surface: &Surface, [u, v]: [f64; 2]) -> f64 {
    u.min(v).min(surface.width() - u).min(surface.height() - v)
}

/// Returns the distances of the true face from the measured one, inside and near an edge.
fn heights(surface: &Surface, truth: &TrueFace) -> (Vec<f64>, Vec<f64>) {
    let (mut inside, mut edge) = (Vec::new(), Vec::new());
    for (k, at) in truth.position_m.iter().enumerate() {
        let start = place(surface, k, [truth.nu, truth.nv]);
        let height = height(surface, start, Vec3::from(*at));
        if from_edge(surface, start) < EDGE_STRIP { edge.push(height) } else { inside.push(height) }
    }
    (inside, edge)
}

/// Returns the height of a point over the measured face at its orthogonal projection. The point's own (u, v) is not
/// used, since it contains the error of the flattening.
fn height(surface: &Surface, [mut u, mut v]: [f64; 2], point: Vec3) -> f64 {
    for _ in 0..FOOT_STEPS {
        let at = surface.derivatives(u, v);
        let off = point - surface.face(u, v);
        u = (u + off.dot(&at.u) / at.u.norm_squared()).clamp(0.0, surface.width());
        v = (v + off.dot(&at.v) / at.v.norm_squared()).clamp(0.0, surface.height());
    }
    (point - surface.face(u, v)).dot(&surface.normal(u, v))
}

/// Measured minus true sides and angles of the cells of a lattice drawn on the plate.
struct Cells {
    side_u: Vec<f64>,
    side_v: Vec<f64>,
    angle: Vec<f64>,
}

impl Cells {
    fn of(surface: &Surface, truth: &TrueGrid) -> Self {
        let size @ [nu, nv] = [truth.nu, truth.nv];
        let found: Vec<Vec3> =
            (0..nu * nv).map(|k| place(surface, k, size)).map(|[u, v]| surface.face(u, v)).collect();
        let known: Vec<Vec3> = truth.position_m.iter().map(|p| Vec3::from(*p)).collect();
        let side = |points: &[Vec3], k: usize, step: usize| points[k + step] - points[k];
        let longer = |k: usize, step: usize| side(&found, k, step).norm() - side(&known, k, step).norm();
        let wider = |k: usize| {
            let angle = |points: &[Vec3]| side(points, k, 1).angle(&side(points, k, nu));
            angle(&found) - angle(&known)
        };
        let column = |k: &usize| k % nu + 1 < nu;
        let row = |k: &usize| k / nu + 1 < nv;
        Self {
            side_u: (0..nu * nv).filter(column).map(|k| longer(k, 1)).collect(),
            side_v: (0..nu * nv).filter(row).map(|k| longer(k, nu)).collect(),
            angle: (0..nu * nv).filter(column).filter(row).map(wider).collect(),
        }
    }
}

/// Returns measured minus true curvatures along u and along v.
fn curvature(surface: &Surface, truth: &TrueGrid) -> Vec<f64> {
    let mut errors = Vec::new();
    for k in 0..truth.nu * truth.nv {
        let at @ [u, v] = place(surface, k, [truth.nu, truth.nv]);
        if from_edge(surface, at) >= CURVATURE_STRIP {
            let found = surface.curvature(u, v);
            errors.extend([found.u - truth.kappa_u_per_m[k], found.v - truth.kappa_v_per_m[k]]);
        }
    }
    errors
}
