//! Baseline: outline of the blank from a scan of it, by development into the plane and a rigid least-squares fit.
//!
//! 1. The blank, which is flat or slightly curved, is developed into the plane ([`lay_flat`]).
//! 2. A parabola is fitted to each edge, and adjacent parabolas are intersected in the corners. Waves shorter than a
//!    bow are an error of the scan, some tenths of a millimetre.
//! 3. The nominal rectangle is fitted to the blank's corners by least squares (rigid): a plate cut 4 mm too long
//!    overhangs by 2 mm on each side, as without a baseline.
//!
//! (u, v) are then metric on the real plate. Limit: a blank that is already curved in two directions gives no outline;
//! the error states the strain.

use nalgebra::{Matrix3, Vector3};

use crate::flatten::lay_flat;
use crate::measure::N_VERTICES;
use crate::mesh::{DiskMesh, MeshError, SmoothFace};
use crate::{Blank, Outline, Patch, PlateSpec};

/// Largest distance of a corner or an edge from its place as ordered, metres. A larger one is taken for a wrong corner
/// or another plate, not for a bad cut. S extends beyond its rectangle by this much without loss.
const MOST_OFF: f64 = 0.02;
/// Largest strain of the developed plate. With more, the outline depends on the law of the material, which is unknown
/// after pressing: on a sphere of 80 m radius (4 x 3 m, strain 3.6e-5) the outline is right to 0.02 mm for steel that
/// was bent elastically, and off by up to 0.45 mm for fibres that kept their length in one direction.
const MOST_STRAIN: f64 = 5e-5;

/// Reason why a scan gives no outline of the blank.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of a variant names its fields")]
pub enum BlankError {
    /// No mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The blank cannot be developed.
    #[error("the blank cannot be laid flat: {reason}; scan it again")]
    Rough { reason: String },
    /// The blank is curved in two directions.
    #[error(
        "the blank is curved in two directions: laid flat it keeps a strain of {strain:.1e}, {MOST_STRAIN:.0e} at most; scan it before it \
         is pressed"
    )]
    Curved { strain: f64 },
    /// The blank is not the plate of the plate file.
    #[error(
        "the blank is {:.1} x {:.1} mm and up to {:.1} mm off its rectangle as ordered, {:.0} mm at most; check width_mm and \
         height_mm, or which plate was scanned",
        .size[0] * 1e3, .size[1] * 1e3, .off * 1e3, MOST_OFF * 1e3
    )]
    OffSize {
        /// Mean extents, metres.
        size: [f64; 2],
        /// Largest distance, metres.
        off: f64,
    },
}

impl Blank {
    /// Measures the outline of the blank in a scan of it.
    ///
    /// # Errors
    /// [`BlankError`].
    pub fn of_scan(patch: &Patch, outline: &Outline, spec: &PlateSpec) -> Result<Self, BlankError> {
        let face = SmoothFace::of(patch, outline, spec);
        let (mesh, _) = face.mesh(outline, spec, &spec.rectangle(), N_VERTICES)?;
        Self::of_mesh(&mesh)
    }

    /// Measures the outline of a mesh by developing it.
    ///
    /// # Errors
    /// [`BlankError`].
    pub fn of_mesh(mesh: &DiskMesh) -> Result<Self, BlankError> {
        let rough = |reason: &str| BlankError::Rough { reason: reason.to_owned() };
        let flat = lay_flat(mesh).map_err(|e| rough(&e.to_string()))?;
        let flat =
            flat.ok_or_else(|| rough("its mesh folds over, or does not come to rest, when it is laid flat"))?;
        let curves = [0, 1, 2, 3].map(|edge| {
            let vertices = mesh.edge(edge).map(|at| mesh.boundary[at % mesh.boundary.len()] as usize);
            Curve::fit(&vertices.map(|vertex| flat.uv[vertex]).collect::<Vec<_>>())
        });
        let [Some(bottom), Some(right), Some(top), Some(left)] = curves else {
            return Err(rough("an edge has too few vertices"));
        };
        let curves = [bottom, right, top, left];
        let corners = [0, 1, 2, 3].map(|k| curves[(k + 3) % 4].meets(&curves[k]));
        let ordered = Self::rectangle(mesh.width, mesh.height);
        let blank = Self {
            corners: registered(corners, ordered.corners),
            bows: curves.each_ref().map(Curve::bow),
            corner_sigma: mesh.corner_sigma,
            // Deviations of an edge from its parabola also count as uncertainty.
            edge_sigma: [0, 1, 2, 3].map(|edge| mesh.edge_sigma[edge].max(curves[edge].rms)),
        };
        let blank = blank.rounded();
        let off = blank.off(&ordered);
        if off.is_nan() || off > MOST_OFF {
            return Err(BlankError::OffSize { size: blank.size(), off });
        }
        if flat.strain > MOST_STRAIN {
            return Err(BlankError::Curved { strain: flat.strain });
        }
        Ok(blank)
    }

    /// Returns the largest distance of a corner or an edge from its place on the rectangle.
    fn off(&self, ordered: &Self) -> f64 {
        let corners = self.corners.iter().zip(ordered.corners).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]));
        corners.chain(self.bows.map(f64::abs)).fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a })
    }
}

/// An edge in the plane: a parabola over the line from its first point to its last.
struct Curve {
    middle: [f64; 2],
    /// Half the vector from end to end.
    half: [f64; 2],
    /// Coefficients of the height to the right of the line, metres, by powers of the place t, -1 to 1.
    height: [f64; 3],
    /// Root mean square distance of the points from the parabola.
    rms: f64,
}

impl Curve {
    /// Fits a parabola to the points by least squares; `None` for fewer than three points.
    fn fit(points: &[[f64; 2]]) -> Option<Self> {
        let (from, to) = (points.first()?, points.last()?);
        let middle = [0, 1].map(|c| 0.5 * (from[c] + to[c]));
        let half = [0, 1].map(|c| 0.5 * (to[c] - from[c]));
        let square = half[0] * half[0] + half[1] * half[1];
        let place = |p: &[f64; 2]| {
            let off = [p[0] - middle[0], p[1] - middle[1]];
            let height = (off[0] * half[1] - off[1] * half[0]) / square.sqrt();
            let t = (off[0] * half[0] + off[1] * half[1]) / square;
            (Vector3::new(1.0, t, t * t), height)
        };
        let (mut normal, mut rhs) = (Matrix3::zeros(), Vector3::zeros());
        for (powers, height) in points.iter().map(place) {
            normal += powers * powers.transpose();
            rhs += powers * height;
        }
        let height = normal.cholesky()?.solve(&rhs);
        let residual = |p| {
            let (powers, seen): (Vector3<f64>, f64) = place(p);
            (seen - powers.dot(&height)).powi(2)
        };
        let rms = (points.iter().map(residual).sum::<f64>() / points.len() as f64).sqrt();
        Some(Self { middle, half, height: height.into(), rms })
    }

    /// Returns the place and its derivative by t.
    fn at(&self, t: f64) -> ([f64; 2], [f64; 2]) {
        let [h, k] = self.half;
        let [a, b, c] = self.height.map(|x| x / h.hypot(k));
        let (out, slope) = (a + t * (b + t * c), b + 2.0 * t * c);
        ([self.middle[0] + t * h + out * k, self.middle[1] + t * k - out * h], [h + slope * k, k - slope * h])
    }

    /// Intersects the end of this edge with the beginning of the next one by Newton's method; edges are nearly
    /// straight.
    fn meets(&self, next: &Self) -> [f64; 2] {
        const STEPS: usize = 4;
        let (mut s, mut t) = (1.0, -1.0);
        for _ in 0..STEPS {
            let ((p, along), (q, other)) = (self.at(s), next.at(t));
            let off = [q[0] - p[0], q[1] - p[1]];
            let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
            let turn = cross(along, other);
            s += cross(off, other) / turn;
            t += cross(off, along) / turn;
        }
        next.at(t).0
    }

    fn bow(&self) -> f64 {
        -self.height[2]
    }
}

/// Registers the corners to the ordered ones by a rigid motion, by least squares.
fn registered(corners: [[f64; 2]; 4], ordered: [[f64; 2]; 4]) -> [[f64; 2]; 4] {
    let middle = |of: &[[f64; 2]; 4]| [0, 1].map(|c| 0.25 * of.iter().map(|p| p[c]).sum::<f64>());
    let (from, to) = (middle(&corners), middle(&ordered));
    let (mut dot, mut cross) = (0.0, 0.0);
    for (p, q) in corners.iter().zip(&ordered) {
        let (p, q) = ([p[0] - from[0], p[1] - from[1]], [q[0] - to[0], q[1] - to[1]]);
        dot += p[0] * q[0] + p[1] * q[1];
        cross += p[0] * q[1] - p[1] * q[0];
    }
    let (cos, sin) = (dot / dot.hypot(cross), cross / dot.hypot(cross));
    corners.map(|p| {
        let p = [p[0] - from[0], p[1] - from[1]];
        [to[0] + cos * p[0] - sin * p[1], to[1] + sin * p[0] + cos * p[1]]
    })
}

#[cfg(test)]
mod tests;
