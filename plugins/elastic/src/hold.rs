//! How the known rectangle holds the material places of the boundary.
//!
//! An edge of the plate is seen at its place up to `edge_sigma`, a corner up to `corner_sigma`; the material may slide
//! along an edge. Each is a spring across the edge, or at the corner along both of its edges. Read as statistics, the
//! minimum of membrane energy plus springs is the likeliest chart when the membrane strain scatters by `strain` around
//! zero and the edge's place by `edge_sigma`, the same all along the edge: the springs of one edge share
//!
//! ```text
//! k = strain^2 W H / edge_sigma^2        (Young's modulus 1)
//! ```
//!
//! by arc length. `strain` is the scatter of the harmonic map's strain about its mean over the plate; the mean is what a
//! wrong place of the edges puts in. So on a sphere, where strain must be, the edges hold hard (strain 2e-3, 4 x 3 m,
//! 0.1 mm: k = 5000 against about 1 of the plate), and on a rolled plate, whose own measures are known better than its
//! edges' places, a misfit is shared between two opposite edges instead of being stretched into the plate.

use platen_shape::DiskMesh;
use platen_shape::sparse::Spd;

/// No edge is known better than this, metres: keeps the springs of perfect edges within the reach of f64.
const MIN_SIGMA: f64 = 1e-6;

/// No plate lies stiller than this: 1 K of heat.
const MIN_STRAIN: f64 = 1e-5;

/// One coordinate of a vertex drawn to its known value.
struct Spring {
    vertex: u32,
    axis: usize,
    place: f64,
    stiffness: f64,
}

/// All springs of a plate.
pub(crate) struct Hold(Vec<Spring>);

impl Hold {
    /// The springs of `mesh` for a membrane strain that scatters by `strain`.
    pub(crate) fn new(mesh: &DiskMesh, strain: f64) -> Self {
        let scale = strain.max(MIN_STRAIN).powi(2) * mesh.width * mesh.height;
        let stiffness = |sigma: f64| scale / sigma.max(MIN_SIGMA).powi(2);
        // Edges v = 0, u = W, v = H, u = 0.
        let lines = [(1, 0.0), (0, mesh.width), (1, mesh.height), (0, 0.0)];
        let mut springs = Vec::new();
        for (edge, &(axis, place)) in lines.iter().enumerate() {
            let end = *mesh.edge(edge).end();
            let arc = |at: usize| if at == end { mesh.edge_length[edge] } else { mesh.arc[at] };
            for at in mesh.edge(edge) {
                let from = arc(at.max(mesh.edge(edge).start() + 1) - 1);
                let share = 0.5 * (arc((at + 1).min(end)) - from) / mesh.edge_length[edge];
                let vertex = mesh.boundary[at % mesh.boundary.len()];
                springs.push(Spring {
                    vertex,
                    axis,
                    place,
                    stiffness: share * stiffness(mesh.edge_sigma[edge]),
                });
            }
        }
        for (corner, [leaving, arriving]) in mesh.corner_sigma.iter().enumerate() {
            let vertex = mesh.boundary[mesh.corners[corner] as usize];
            // Along the edge that leaves, the corner lies on the line of the edge that arrives, and the reverse.
            for (line, sigma) in [((corner + 3) % 4, leaving), (corner, arriving)] {
                let (axis, place) = lines[line];
                springs.push(Spring { vertex, axis, place, stiffness: stiffness(*sigma) });
            }
        }
        Self(springs)
    }

    pub(crate) fn energy(&self, x: &[[f64; 2]]) -> f64 {
        self.0.iter().map(|s| 0.5 * s.stiffness * (x[s.vertex as usize][s.axis] - s.place).powi(2)).sum()
    }

    pub(crate) fn add_gradient(&self, x: &[[f64; 2]], gradient: &mut [[f64; 2]]) {
        for s in &self.0 {
            gradient[s.vertex as usize][s.axis] += s.stiffness * (x[s.vertex as usize][s.axis] - s.place);
        }
    }

    pub(crate) fn add_hessian(&self, spd: &mut Spd<2>) {
        for s in &self.0 {
            let mut block = [[0.0; 2]; 2];
            block[s.axis][s.axis] = s.stiffness;
            spd.add(s.vertex, s.vertex, block);
        }
    }
}
