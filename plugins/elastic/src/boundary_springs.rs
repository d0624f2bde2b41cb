//! Boundary springs: the prior of the outline on the material positions of the boundary.
//!
//! The position of an edge is known with standard deviation `edge_sigma`, that of a corner with `corner_sigma`; the
//! material may slide along an edge. Each uncertainty is modelled by a spring along the outline's normal at the vertex,
//! at a corner along the normals of both edges. Sliding by s along an edge of radius R leaves the edge by s^2 / 2R,
//! which is negligible on a plate.
//!
//! The stiffness is chosen so that the minimum of membrane energy plus springs is the maximum a posteriori chart. The
//! assumed priors are: the membrane strain has the standard deviation `strain` around zero, and the edge's position has
//! `edge_sigma`, fully correlated along the edge. The total stiffness of one edge, distributed to its springs by arc
//! length, is
//!
//! ```text
//! k = strain^2 W H / edge_sigma^2        (Young's modulus 1)
//! ```
//!
//! `strain` is the standard deviation of the harmonic map's strain about its mean over the plate; the mean is the
//! effect of misplaced edges. On a sphere, where the plate must be strained, the edges are therefore practically fixed
//! (strain 2e-3, 4 x 3 m, 0.1 mm: k = 5000 against about 1 of the plate). On a rolled plate the dimensions are more
//! certain than the positions of the edges. There a misfit is shared between two opposite edges instead of stretching
//! the plate.

use platen_numerics::sparse::Spd;
use platen_shape::DiskMesh;

/// Least standard deviation of an edge, metres: keeps the springs of perfect edges within the range of f64.
const MIN_SIGMA: f64 = 1e-6;

/// Least standard deviation of the strain: the thermal strain of 1 K.
const MIN_STRAIN: f64 = 1e-5;

/// Spring from a vertex to its known position, along one direction.
struct Spring {
    vertex: u32,
    normal: [f64; 2],
    place: [f64; 2],
    stiffness: f64,
}

impl Spring {
    /// Returns the distance of the vertex from its known position along the normal.
    fn stretch(&self, x: &[[f64; 2]]) -> f64 {
        let x = x[self.vertex as usize];
        self.normal[0] * (x[0] - self.place[0]) + self.normal[1] * (x[1] - self.place[1])
    }
}

/// Springs of a plate.
pub(crate) struct BoundarySprings(Vec<Spring>);

impl BoundarySprings {
    /// Makes the springs of `mesh` for a membrane strain of standard deviation `strain`.
    pub(crate) fn new(mesh: &DiskMesh, strain: f64) -> Self {
        let scale = strain.max(MIN_STRAIN).powi(2) * mesh.width * mesh.height;
        let stiffness = |sigma: f64| scale / sigma.max(MIN_SIGMA).powi(2);
        let n = mesh.boundary.len();
        let spring = |at: usize, normal: [f64; 2], stiffness: f64| {
            let at = at % n;
            Spring { vertex: mesh.boundary[at], normal, place: mesh.places[at], stiffness }
        };
        let mut springs = Vec::new();
        for edge in 0..4 {
            let end = *mesh.edge(edge).end();
            let arc = |at: usize| if at == end { mesh.edge_length[edge] } else { mesh.arc[at] };
            for at in mesh.edge(edge) {
                let from = arc(at.max(mesh.edge(edge).start() + 1) - 1);
                let share = 0.5 * (arc((at + 1).min(end)) - from) / mesh.edge_length[edge];
                springs.push(spring(at, normal(mesh, edge, at), share * stiffness(mesh.edge_sigma[edge])));
            }
        }
        for (corner, [leaving, arriving]) in mesh.corner_sigma.iter().enumerate() {
            // The position along the leaving edge is held across the arriving edge, and the reverse.
            let before = (corner + 3) % 4;
            let (start, end) = (*mesh.edge(corner).start(), *mesh.edge(before).end());
            springs.push(spring(start, normal(mesh, before, end), stiffness(*leaving)));
            springs.push(spring(start, normal(mesh, corner, start), stiffness(*arriving)));
        }
        Self(springs)
    }

    pub(crate) fn energy(&self, x: &[[f64; 2]]) -> f64 {
        self.0.iter().map(|s| 0.5 * s.stiffness * s.stretch(x).powi(2)).sum()
    }

    pub(crate) fn add_gradient(&self, x: &[[f64; 2]], gradient: &mut [[f64; 2]]) {
        for s in &self.0 {
            let force = s.stiffness * s.stretch(x);
            let slot = &mut gradient[s.vertex as usize];
            (0..2).for_each(|c| slot[c] += force * s.normal[c]);
        }
    }

    pub(crate) fn add_hessian(&self, spd: &mut Spd<2>) {
        for s in &self.0 {
            let block = s.normal.map(|a| s.normal.map(|b| s.stiffness * a * b));
            spd.add(s.vertex, s.vertex, block);
        }
    }
}

/// Returns the unit normal of the outline at position `at` of an edge: perpendicular to the chord between its
/// neighbours.
fn normal(mesh: &DiskMesh, edge: usize, at: usize) -> [f64; 2] {
    let range = mesh.edge(edge);
    let place = |at: usize| mesh.places[at % mesh.places.len()];
    let (from, to) = (place(at.max(range.start() + 1) - 1), place((at + 1).min(*range.end())));
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = along[0].hypot(along[1]);
    [along[1] / length, -along[0] / length]
}
