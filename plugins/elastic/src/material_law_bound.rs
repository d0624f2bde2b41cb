//! Bound on the effect of the material law on a material position: inextensible fibres compared with least energy.
//!
//! The material of a plate that was pressed stroke by stroke need not lie where its membrane energy is least. The
//! opposite extreme is that the fibres along one side of the plate kept their length and all strain went across them.
//! The distance between the two hypotheses is the uncertainty of a position; the larger distance of fibres along u and
//! fibres along v is taken.
//!
//! Strains are small, so the second hypothesis is one linear step from the first. The shift d of the material
//! minimises, by linear finite elements,
//!
//! ```text
//! 1/2 integral of e(d) : D : e(d) + STIFF (E_ff - e_ff(d))^2,   e(d) = (grad d + grad d') / 2, no shift across edges,
//! ```
//!
//! with E the strain of least energy and f the direction of the fibres. The field is smooth: a grid of 16 x 16 cells
//! resolves it to one or two percent.

use platen_numerics::sparse::{Graph, SparseError, Spd};
use platen_shape::flatten::plane_stress;

use crate::membrane::{Strained, Sym};

/// Largest number of cells along each side; fewer where a cell would have fewer than 8 triangles.
const CELLS: usize = 16;
/// Stiffness of the fibres relative to that of the plate.
const STIFF: f64 = 1e3;
/// Penalty stiffness against shifts across the edges.
const HELD: f64 = 1e9;

/// Grid of cells over the plate.
struct Grid {
    n: usize,
    cell: [f64; 2],
    /// Mean strain of each cell.
    strains: Vec<Sym>,
}

/// Returns the absolute shift in u and in v of each position of `uv`, the larger of the two fibre hypotheses, metres.
///
/// `strains` contains the state of every triangle, `uv` the positions of least energy, `size` the extent of the plate
/// in metres.
///
/// # Errors
/// [`SparseError`].
pub(crate) fn material_law_bound(
    strains: &[Strained],
    uv: &[[f64; 2]],
    size: [f64; 2],
    poisson: f64,
) -> Result<Vec<[f64; 2]>, SparseError> {
    let grid = Grid::new(strains, size);
    let shifts = [grid.shifts(0, poisson)?, grid.shifts(1, poisson)?];
    let larger = |p: &[f64; 2]| {
        let [a, b] = [grid.interpolate(&shifts[0], *p), grid.interpolate(&shifts[1], *p)];
        [a[0].abs().max(b[0].abs()), a[1].abs().max(b[1].abs())]
    };
    Ok(uv.iter().map(larger).collect())
}

impl Grid {
    fn new(strains: &[Strained], size: [f64; 2]) -> Self {
        let n = ((strains.len() as f64 / 8.0).sqrt() as usize).clamp(2, CELLS);
        let cell = size.map(|s| s / n as f64);
        let mut sums = vec![(0.0, [0.0; 3]); n * n];
        for &Strained { area, strain, centre } in strains {
            let [i, j] = [0, 1].map(|c| ((centre[c] / cell[c]).max(0.0) as usize).min(n - 1));
            let (total, sum) = &mut sums[j * n + i];
            *total += area;
            (0..3).for_each(|k| sum[k] += area * strain[k]);
        }
        let mean = |(total, sum): (f64, Sym)| if total > 0.0 { sum.map(|s| s / total) } else { sum };
        Self { n, cell, strains: sums.into_iter().map(mean).collect() }
    }

    /// Returns the nodes of each cell's two triangles, with alternating diagonals.
    fn triangles(&self) -> impl Iterator<Item = (usize, [u32; 3])> {
        let n = self.n;
        (0..n * n).flat_map(move |k| {
            let [a, b, c, d] = [0, 1, n + 2, n + 1].map(|step| (k / n * (n + 1) + k % n + step) as u32);
            let even = (k / n + k % n).is_multiple_of(2);
            (if even { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }).map(|t| (k, t))
        })
    }

    fn place(&self, node: u32) -> [f64; 2] {
        let row = self.n as u32 + 1;
        [f64::from(node % row) * self.cell[0], f64::from(node / row) * self.cell[1]]
    }

    /// Solves for the shift of every node when the fibres along `fibre` (0: u, 1: v) keep their length.
    fn shifts(&self, fibre: usize, poisson: f64) -> Result<Vec<[f64; 2]>, SparseError> {
        let n_nodes = (self.n + 1) * (self.n + 1);
        let places: Vec<_> = (0..n_nodes as u32).map(|node| self.place(node)).collect();
        let elements: Vec<_> = self.triangles().map(|(_, t)| t).collect();
        let nodes: Vec<_> = (0..n_nodes as u32).map(Some).collect();
        let mut spd = Spd::<2>::analyse(&Graph::of_elements(&elements, &nodes, n_nodes), &places)?;
        let mut load = vec![[0.0; 2]; n_nodes];
        let area = 0.5 * self.cell[0] * self.cell[1];
        for (k, t) in self.triangles() {
            let [a, b, c] = t.map(|node| places[node as usize]);
            let hat = |p: [f64; 2], q: [f64; 2]| [(p[1] - q[1]) / (2.0 * area), (q[0] - p[0]) / (2.0 * area)];
            let hats = [hat(b, c), hat(c, a), hat(a, b)];
            for (i, hat) in hats.iter().enumerate() {
                load[t[i] as usize][fibre] += area * STIFF * self.strains[k][fibre] * hat[fibre];
                for j in i..3 {
                    let mut block = plane_stress(hats[i], hats[j], poisson);
                    block[fibre][fibre] += STIFF * hats[i][fibre] * hats[j][fibre];
                    spd.add(t[i], t[j], block.map(|row| row.map(|x| area * x)));
                }
            }
        }
        for (node, slot) in load.iter_mut().enumerate() {
            let (i, j) = (node % (self.n + 1), node / (self.n + 1));
            for (axis, at) in [(0, i), (1, j)] {
                if at == 0 || at == self.n {
                    slot[axis] = 0.0;
                    let mut block = [[0.0; 2]; 2];
                    block[axis][axis] = HELD;
                    spd.add(node as u32, node as u32, block);
                }
            }
        }
        spd.factor()?;
        let mut columns = [load];
        spd.solve(&mut columns)?;
        let [shifts] = columns;
        Ok(shifts)
    }

    fn interpolate(&self, shifts: &[[f64; 2]], p: [f64; 2]) -> [f64; 2] {
        let [x, y] = [0, 1].map(|c| (p[c] / self.cell[c]).clamp(0.0, self.n as f64));
        let [i, j] = [x, y].map(|x| (x as usize).min(self.n - 1));
        let [s, t] = [x - i as f64, y - j as f64];
        let at = j * (self.n + 1) + i;
        let [a, b, c, d] = [0, 1, self.n + 1, self.n + 2].map(|step| shifts[at + step]);
        [0, 1].map(|k| (1.0 - t) * ((1.0 - s) * a[k] + s * b[k]) + t * ((1.0 - s) * c[k] + s * d[k]))
    }
}
