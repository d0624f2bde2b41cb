//! Blank: the outline of the plate as it was cut, in its own plane.
//!
//! The outline as ordered is an exact rectangle. A scan of the blank refines it (`correspondence`): each edge is then a
//! line with a bow, that is, a parabola. All later strokes of the same plate are mapped to this outline. S(u, v) keeps
//! the rectangle as ordered, and continues beyond it where the plate is larger by millimetres.

/// Number of steps per metre of a rounded outline.
const PER_METRE: f64 = (1_u64 << 30) as f64;
/// Outline of the blank in material coordinates (u, v).
///
/// The edges are v = 0, u = W, v = H, u = 0, each from corner to corner, counter-clockwise like the boundary of a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blank {
    /// Corners (0,0), (W,0), (W,H), (0,H), metres.
    pub corners: [[f64; 2]; 4],
    /// Per edge: distance of its middle outside the straight line between its corners, metres; the edge is a parabola.
    pub bows: [f64; 4],
    /// Per corner: standard deviation along the edge that leaves it and along the one that arrives, metres.
    pub corner_sigma: [[f64; 2]; 4],
    /// Per edge: standard deviation across it, metres.
    pub edge_sigma: [f64; 4],
}

impl Blank {
    /// Builds the rectangle as ordered, metres, without uncertainty.
    #[must_use]
    pub fn rectangle(width: f64, height: f64) -> Self {
        Self {
            corners: [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]],
            bows: [0.0; 4],
            corner_sigma: [[0.0; 2]; 4],
            edge_sigma: [0.0; 4],
        }
    }

    /// Rounds to multiples of 2^-30 m (about a nanometre): a rounded outline that is written as text in millimetres,
    /// read and rounded again is the same to the last bit.
    #[must_use]
    pub fn rounded(mut self) -> Self {
        let sigmas = self.corner_sigma.iter_mut().flatten().chain(&mut self.edge_sigma);
        for x in self.corners.iter_mut().flatten().chain(&mut self.bows).chain(sigmas) {
            *x = (*x * PER_METRE).round() / PER_METRE;
        }
        self
    }

    /// Returns the lengths of the edges, straight from corner to corner, metres.
    #[must_use]
    pub fn edge_lengths(&self) -> [f64; 4] {
        [(0, 1), (1, 2), (2, 3), (3, 0)].map(|(a, b)| self.distance(a, b))
    }

    /// Returns the lengths of the scanned face's edges on the flat plate, metres; on a bevelled plate they are `inset`
    /// shorter at both ends.
    #[must_use]
    pub fn face_edge_lengths(&self, inset: f64) -> [f64; 4] {
        self.edge_lengths().map(|length| length - 2.0 * inset)
    }

    /// Returns the mean lengths of opposite edges, straight from corner to corner: along u, along v, metres.
    #[must_use]
    pub fn size(&self) -> [f64; 2] {
        let [bottom, right, top, left] = self.edge_lengths();
        [0.5 * (bottom + top), 0.5 * (right + left)]
    }

    /// Returns the diagonal from (0,0) less the one from (W,0), metres.
    #[must_use]
    pub fn diagonal_difference(&self) -> f64 {
        self.distance(0, 2) - self.distance(1, 3)
    }

    fn distance(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (self.corners[a], self.corners[b]);
        (b[0] - a[0]).hypot(b[1] - a[1])
    }

    /// Returns the place on an edge at a share (0 to 1) of its length from its first corner, metres.
    #[must_use]
    pub fn place(&self, edge: usize, share: f64) -> [f64; 2] {
        let next = (edge + 1) % 4;
        // Opposite edges are both evaluated towards growing u or v: on a rectangle they then agree to the last bit.
        let (from, to, along) = if edge < 2 { (edge, next, share) } else { (next, edge, 1.0 - share) };
        let (from, to) = (self.corners[from], self.corners[to]);
        let way = [to[0] - from[0], to[1] - from[1]];
        let on_line = [from[0] + along * way[0], from[1] + along * way[1]];
        if self.bows[edge] == 0.0 {
            return on_line;
        }
        let out = 4.0 * self.bows[edge] * share * (1.0 - share) / way[0].hypot(way[1]);
        let out = if edge < 2 { out } else { -out };
        [on_line[0] + way[1] * out, on_line[1] - way[0] * out]
    }

    /// Places the vertices of a boundary loop by their share of their edge's arc length (Masuda et al., 4.3): one place
    /// per vertex, metres. `corners` are the corners' positions in the loop, `arc` the vertices' arc lengths from the
    /// first corner of their edge.
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
