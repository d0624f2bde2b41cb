//! The outline of the plate as it was cut, in its own plane.
//!
//! As ordered it is a rectangle, exactly. A scan of the blank, flat or a little curved, tells more: laid flat
//! ([`lay_flat`]), its boundary is the outline that all later strokes of the same plate are mapped to. (u, v) are then
//! metric on the real plate: corner (0,0) in the origin, u along the straight line to corner (W,0). S(u, v) keeps the rectangle as
//! ordered, and goes on beyond it where the plate is larger by millimetres.

use crate::flatten::lay_flat;
use crate::measure::N_VERTICES;
use crate::mesh::{DiskMesh, Face, MeshError};
use crate::{Outline, Patch, PlateSpec};

/// Places along an edge at which its bulge is kept: 130 mm apart on 4 m, 4 um from a bow of 2 mm.
const BULGE_PLACES: usize = 33;
/// A corner or an edge further from its place as ordered than this, metres, is not cut badly but mistaken, or another plate's.
/// S reads on beyond its rectangle by as much without harm.
const MOST_OFF: f64 = 0.02;
/// More strain than this in a plate laid flat, and the law of the material, which nobody knows once it was pressed, decides where its
/// outline was: on a sphere of 80 m radius (4 x 3 m, strain 3.6e-5) it is right to 0.02 mm for steel that was bent elastically, and
/// off by up to 0.8 mm for fibres that kept their length one way.
const MOST_STRAIN: f64 = 5e-5;

/// Where the material of the four edges lies in (u, v).
///
/// Edges v = 0, u = W, v = H, u = 0, each from corner to corner counter-clockwise as the boundary of a
/// [`DiskMesh`]. What an edge bulges is given at equal shares of its length; in between it is straight.
#[derive(Debug, Clone, PartialEq)]
pub struct Blank {
    /// Corners (0,0), (W,0), (W,H), (0,H), metres.
    pub corners: [[f64; 2]; 4],
    /// Per edge, at equal shares from its first corner to its last: how far it lies outside the straight line between them, metres.
    /// Empty: nowhere.
    pub bulge: [Vec<f64>; 4],
    /// Per corner: standard deviation along the edge that leaves it and along the one that arrives, metres.
    pub corner_sigma: [[f64; 2]; 4],
    /// Per edge: standard deviation across it, metres.
    pub edge_sigma: [f64; 4],
}

/// Why a scan tells no outline of the blank.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BlankError {
    /// No mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// It cannot be laid flat.
    #[error("the blank cannot be laid flat: {reason}; scan it again")]
    Rough {
        /// Why not.
        reason: String,
    },
    /// It is curved two ways.
    #[error(
        "the blank is curved two ways: laid flat it keeps a strain of {strain:.1e}, {MOST_STRAIN:.0e} at most; scan it before it \
         is pressed"
    )]
    Curved {
        /// Root mean square strain.
        strain: f64,
    },
    /// It is not the plate of the plate file.
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
    /// The rectangle as ordered, metres: known exactly.
    #[must_use]
    pub fn rectangle(width: f64, height: f64) -> Self {
        Self {
            corners: [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]],
            bulge: Default::default(),
            corner_sigma: [[0.0; 2]; 4],
            edge_sigma: [0.0; 4],
        }
    }

    /// The outline of the blank in a scan of it.
    ///
    /// # Errors
    /// [`BlankError`].
    pub fn of_scan(patch: &Patch, outline: &Outline, spec: &PlateSpec) -> Result<Self, BlankError> {
        let face = Face::of(patch, outline, spec);
        let (mesh, _) = face.mesh(outline, spec, &spec.rectangle(), N_VERTICES)?;
        Self::of_mesh(&mesh)
    }

    /// The outline of a mesh laid flat.
    ///
    /// # Errors
    /// [`BlankError`].
    pub fn of_mesh(mesh: &DiskMesh) -> Result<Self, BlankError> {
        let rough = |reason: &str| BlankError::Rough { reason: reason.to_owned() };
        let flat = lay_flat(mesh).map_err(|e| rough(&e.to_string()))?;
        let flat = flat.ok_or_else(|| rough("its mesh folds over"))?;
        let place = |at: usize| flat.uv[mesh.boundary[at % mesh.boundary.len()] as usize];
        let corners = mesh.corners.map(|at| place(at as usize));
        let bulge = [0, 1, 2, 3].map(|edge| {
            let line = Line { from: corners[edge], to: corners[(edge + 1) % 4] };
            at_equal_shares(&mesh.edge(edge).map(|at| line.share_and_height(place(at))).collect::<Vec<_>>())
        });
        let (corner_sigma, edge_sigma) = (mesh.corner_sigma, mesh.edge_sigma);
        let blank = Self { corners, bulge, corner_sigma, edge_sigma };
        let off = blank.off(mesh.width, mesh.height);
        if off.is_nan() || off > MOST_OFF {
            return Err(BlankError::OffSize { size: blank.size(), off });
        }
        if flat.strain > MOST_STRAIN {
            return Err(BlankError::Curved { strain: flat.strain });
        }
        Ok(blank)
    }

    /// Mean lengths of opposite edges, straight from corner to corner: along u, along v, metres.
    #[must_use]
    pub fn size(&self) -> [f64; 2] {
        let [bottom, right, top, left] = [(0, 1), (1, 2), (2, 3), (3, 0)].map(|(a, b)| self.distance(a, b));
        [0.5 * (bottom + top), 0.5 * (right + left)]
    }

    /// The diagonal from (0,0) less the one from (W,0), metres.
    #[must_use]
    pub fn diagonal_difference(&self) -> f64 {
        self.distance(0, 2) - self.distance(1, 3)
    }

    /// The furthest that each edge lies outside the straight line between its corners, negative: inside; metres.
    #[must_use]
    pub fn bows(&self) -> [f64; 4] {
        let furthest = |a: f64, b: &f64| if b.abs() > a.abs() { *b } else { a };
        self.bulge.each_ref().map(|bulge| bulge.iter().fold(0.0, furthest))
    }

    /// How far a corner or an edge lies from its place on the rectangle, at most.
    fn off(&self, width: f64, height: f64) -> f64 {
        let ordered = Self::rectangle(width, height).corners;
        let corners = self.corners.iter().zip(ordered).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]));
        corners.chain(self.bows().map(f64::abs)).fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a })
    }

    fn distance(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (self.corners[a], self.corners[b]);
        (b[0] - a[0]).hypot(b[1] - a[1])
    }

    /// The place on an edge at a share (0 to 1) of its length from its first corner, metres.
    #[must_use]
    pub fn place(&self, edge: usize, share: f64) -> [f64; 2] {
        let next = (edge + 1) % 4;
        // Opposite edges are both walked towards growing u or v: on a rectangle they then agree to the last bit.
        let (from, to, along) = if edge < 2 { (edge, next, share) } else { (next, edge, 1.0 - share) };
        let line = Line { from: self.corners[from], to: self.corners[to] };
        let bulge = &self.bulge[edge];
        if bulge.len() < 2 {
            return line.at(along, 0.0);
        }
        let at = share.clamp(0.0, 1.0) * (bulge.len() - 1) as f64;
        let first = (at as usize).min(bulge.len() - 2);
        let height = bulge[first] + (at - first as f64) * (bulge[first + 1] - bulge[first]);
        line.at(along, if edge < 2 { height } else { -height })
    }

    /// Where the vertices of a boundary loop lie when every one keeps its share of its edge's arc length (paper, section
    /// 4.3): one place a vertex, metres. `corners` are the corners' positions in the loop, `arc` the vertices' arc lengths from the first
    /// corner of their edge.
    #[must_use]
    pub fn places(&self, corners: [usize; 4], arc: &[f64], edge_length: [f64; 4]) -> Vec<[f64; 2]> {
        let edge_of = |at: usize| (0..4).rev().find(|&edge| corners[edge] <= at).unwrap_or(0);
        let place = |(at, arc): (usize, &f64)| {
            let edge = edge_of(at);
            self.place(edge, arc / edge_length[edge])
        };
        arc.iter().enumerate().map(place).collect()
    }
}

/// A straight line in the plane.
struct Line {
    from: [f64; 2],
    to: [f64; 2],
}

impl Line {
    fn way(&self) -> [f64; 2] {
        [self.to[0] - self.from[0], self.to[1] - self.from[1]]
    }

    /// The place at a share of its length, and a height to its right.
    fn at(&self, share: f64, height: f64) -> [f64; 2] {
        let way = self.way();
        let on_line = [self.from[0] + share * way[0], self.from[1] + share * way[1]];
        if height == 0.0 {
            return on_line;
        }
        let outwards = height / way[0].hypot(way[1]);
        [on_line[0] + way[1] * outwards, on_line[1] - way[0] * outwards]
    }

    /// The reverse.
    fn share_and_height(&self, place: [f64; 2]) -> [f64; 2] {
        let (way, off) = (self.way(), [place[0] - self.from[0], place[1] - self.from[1]]);
        let square = way[0] * way[0] + way[1] * way[1];
        let height = (off[0] * way[1] - off[1] * way[0]) / square.sqrt();
        [(off[0] * way[0] + off[1] * way[1]) / square, height]
    }
}

/// Heights at equal shares from 0 to 1, straight between the given ones, whose shares grow.
fn at_equal_shares(given: &[[f64; 2]]) -> Vec<f64> {
    let height = |k: usize| {
        let share = k as f64 / (BULGE_PLACES - 1) as f64;
        let next = given.partition_point(|g| g[0] < share).clamp(1, given.len() - 1);
        let ([s0, h0], [s1, h1]) = (given[next - 1], given[next]);
        h0 + (share - s0) / (s1 - s0) * (h1 - h0)
    };
    let mut heights: Vec<f64> = (0..BULGE_PLACES).map(height).collect();
    (heights[0], heights[BULGE_PLACES - 1]) = (0.0, 0.0);
    heights
}

#[cfg(test)]
mod tests;
