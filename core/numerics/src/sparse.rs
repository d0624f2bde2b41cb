//! Sparse Cholesky factorisation of symmetric positive definite systems on meshes, ordered by nested dissection.
//!
//! A system has `D` unknowns per node of a [`Graph`]; nodes that share an edge of the graph may couple.
//! [`Spd::analyse`] orders the nodes and analyses the factor once; after that [`Spd::clear`], [`Spd::add`],
//! [`Spd::factor`] and [`Spd::solve`] may be repeated with other values on the same graph.
//!
//! The factorisation is that of faer, supernodal at every size (faer's own choice is simplicial up to 10,000 unknowns,
//! which is slower there) and always on one thread, so that results never depend on the machine's load or cores. The
//! matrix is stored as its upper triangle in elimination order, so that faer neither orders nor permutes it.

mod elimination_order;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};

use crate::vector_registers::ClearVectorRegisters;

/// Reason why a system could not be solved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SparseError {
    /// The matrix has no Cholesky factor: some unknowns are not constrained, or an element is indefinite.
    #[error("the system of {unknowns} unknowns is not positive definite")]
    NotPositiveDefinite {
        /// Number of unknowns.
        unknowns: usize,
    },
    /// The factor does not fit in memory or in 32-bit indices.
    #[error("the system of {unknowns} unknowns is too large: {reason}")]
    TooLarge {
        /// Number of unknowns.
        unknowns: usize,
        /// Message of faer.
        reason: String,
    },
}

/// Undirected graph: the neighbours of each node; each pair is listed from both ends, and no node is its own neighbour.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Graph {
    /// Neighbours of node `i` are `neighbours[starts[i]..starts[i + 1]]`; one more entry than nodes.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
}

impl Graph {
    /// Joins the nodes that share an element (triangle) of `elements`.
    ///
    /// `node_of[v]` is the node of vertex `v`, or `None` where the vertex is not an unknown; nodes are `0..n_nodes`.
    pub fn of_elements<const K: usize>(
        elements: &[[u32; K]],
        node_of: &[Option<u32>],
        n_nodes: usize,
    ) -> Self {
        let nodes = |element: &[u32; K]| element.map(|v| node_of[v as usize]);
        let mut starts = vec![0u32; n_nodes + 1];
        for element in elements {
            let nodes = nodes(element);
            let others = nodes.iter().flatten().count().saturating_sub(1) as u32;
            nodes.iter().flatten().for_each(|&i| starts[i as usize + 1] += others);
        }
        for i in 0..n_nodes {
            starts[i + 1] += starts[i];
        }
        let mut free = starts.clone();
        let mut listed = vec![0u32; starts[n_nodes] as usize];
        for element in elements {
            let nodes = nodes(element);
            for (a, i) in nodes.iter().enumerate().filter_map(|(a, i)| Some((a, (*i)? as usize))) {
                for (_, j) in nodes.iter().enumerate().filter(|(b, _)| *b != a) {
                    let Some(j) = *j else { continue };
                    listed[free[i] as usize] = j;
                    free[i] += 1;
                }
            }
        }
        Self::without_repeats(&starts, &mut listed)
    }

    fn without_repeats(starts: &[u32], listed: &mut [u32]) -> Self {
        let mut graph = Self { starts: vec![0], neighbours: Vec::with_capacity(listed.len()) };
        for range in starts.windows(2) {
            let row = &mut listed[range[0] as usize..range[1] as usize];
            row.sort_unstable();
            let mut last = None;
            for &j in row.iter() {
                if last != Some(j) {
                    graph.neighbours.push(j);
                }
                last = Some(j);
            }
            graph.starts.push(graph.neighbours.len() as u32);
        }
        graph
    }

    /// Returns the number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.starts.len() - 1
    }

    /// Returns the neighbours of a node, in increasing order.
    pub fn neighbours(&self, node: u32) -> &[u32] {
        &self.neighbours[self.starts[node as usize] as usize..self.starts[node as usize + 1] as usize]
    }
}

/// A symmetric positive definite system with `D` unknowns per node.
pub struct Spd<const D: usize> {
    /// Place of each node in the elimination order.
    place: Vec<u32>,
    /// Upper neighbours of each place, as places, in increasing order, without the diagonal.
    upper: Graph,
    matrix: SymbolicSparseColMat<u32>,
    values: Vec<f64>,
    symbolic: Option<SymbolicCholesky<u32>>,
    factor: Vec<f64>,
}

impl<const D: usize> Spd<D> {
    /// Orders the nodes of `graph` by bisecting `points` (any projection of the nodes to a plane; only the cost depends
    /// on it) and analyses the factor symbolically. All values are zero afterwards.
    ///
    /// # Errors
    /// [`SparseError::TooLarge`].
    pub fn analyse(graph: &Graph, points: &[[f64; 2]]) -> Result<Self, SparseError> {
        let n_nodes = graph.n_nodes();
        let order = elimination_order::nested_dissection(graph, points);
        let mut place = vec![0u32; n_nodes];
        for (at, &node) in order.iter().enumerate() {
            place[node as usize] = at as u32;
        }
        let upper = upper_triangle(graph, &order, &place);
        let matrix = pattern::<D>(&upper)?;
        let symbolic = (n_nodes > 0)
            .then(|| {
                let params = CholeskySymbolicParams {
                    supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
                    ..Default::default()
                };
                factorize_symbolic_cholesky(matrix.as_ref(), Side::Upper, SymmetricOrdering::Identity, params)
            })
            .transpose()
            .map_err(|e| too_large(n_nodes * D, e))?;
        let values = vec![0.0; matrix.row_idx().len()];
        let factor = vec![0.0; symbolic.as_ref().map_or(0, SymbolicCholesky::len_val)];
        Ok(Self { place, upper, matrix, values, symbolic, factor })
    }

    /// Returns the number of unknowns.
    pub fn n_unknowns(&self) -> usize {
        self.place.len() * D
    }

    /// Sets all values to zero; the factor is not changed.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Adds `block` at (i, j) and its transpose at (j, i); for i = j the block is symmetric and added once.
    ///
    /// `i` and `j` are equal or neighbours in the graph; any other pair is ignored in release builds.
    pub fn add(&mut self, i: u32, j: u32, block: [[f64; D]; D]) {
        let (i, j) = (self.place[i as usize], self.place[j as usize]);
        let (row, column, flip) = if i <= j { (i, j, false) } else { (j, i, true) };
        let above = self.upper.neighbours(column);
        let at = if i == j { Some(above.len()) } else { above.iter().position(|&k| k == row) };
        debug_assert!(at.is_some(), "nodes without a common edge");
        let Some(at) = at else { return };
        let starts = &self.matrix.col_ptr()[column as usize * D..];
        for c in 0..D {
            let first = starts[c] as usize + at * D;
            let rows = if i == j { c + 1 } else { D };
            for (r, value) in self.values[first..first + rows].iter_mut().enumerate() {
                *value += if flip { block[c][r] } else { block[r][c] };
            }
        }
    }

    /// Factors the current matrix.
    ///
    /// # Errors
    /// [`SparseError::NotPositiveDefinite`], also for values that are not finite; [`SparseError::TooLarge`].
    pub fn factor(&mut self) -> Result<(), SparseError> {
        let unknowns = self.n_unknowns();
        let Some(symbolic) = &self.symbolic else { return Ok(()) };
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|e| too_large(unknowns, e))?;
        let (factor, matrix) = (&mut self.factor, SparseColMatRef::new(self.matrix.as_ref(), &self.values));
        let _clear = ClearVectorRegisters;
        let stack = MemStack::new(&mut memory);
        let (shift, plan) = Default::default();
        symbolic
            .factorize_numeric_llt(factor, matrix, Side::Upper, shift, Par::Seq, stack, plan)
            .map(|_| ())
            .map_err(|_| SparseError::NotPositiveDefinite { unknowns })
    }

    /// Solves with the last factor, in place; each column of `columns` is one right-hand side, one entry per node.
    ///
    /// # Errors
    /// [`SparseError::TooLarge`].
    pub fn solve(&self, columns: &mut [Vec<[f64; D]>]) -> Result<(), SparseError> {
        let unknowns = self.n_unknowns();
        let Some(symbolic) = &self.symbolic else { return Ok(()) };
        let scratch = symbolic.solve_in_place_scratch::<f64>(columns.len(), Par::Seq);
        let mut memory = MemBuffer::try_new(scratch).map_err(|e| too_large(unknowns, e))?;
        let mut x = vec![0.0; unknowns * columns.len()];
        for (column, x) in columns.iter().zip(x.chunks_exact_mut(unknowns)) {
            for (value, &place) in column.iter().zip(&self.place) {
                x[place as usize * D..][..D].copy_from_slice(value);
            }
        }
        let right = MatMut::from_column_major_slice_mut(&mut x, unknowns, columns.len());
        let _clear = ClearVectorRegisters;
        let stack = MemStack::new(&mut memory);
        LltRef::new(symbolic, &self.factor).solve_in_place_with_conj(Conj::No, right, Par::Seq, stack);
        for (column, x) in columns.iter_mut().zip(x.chunks_exact(unknowns)) {
            for (value, &place) in column.iter_mut().zip(&self.place) {
                value.copy_from_slice(&x[place as usize * D..][..D]);
            }
        }
        Ok(())
    }
}

fn too_large(unknowns: usize, reason: impl std::fmt::Debug) -> SparseError {
    SparseError::TooLarge { unknowns, reason: format!("{reason:?}") }
}

/// Returns, for each place of the elimination order, its neighbours at earlier places.
fn upper_triangle(graph: &Graph, order: &[u32], place: &[u32]) -> Graph {
    let mut upper = Graph { starts: vec![0], neighbours: Vec::with_capacity(graph.neighbours.len() / 2) };
    for (at, &node) in order.iter().enumerate() {
        let first = upper.neighbours.len();
        let earlier =
            graph.neighbours(node).iter().map(|&k| place[k as usize]).filter(|&k| (k as usize) < at);
        upper.neighbours.extend(earlier);
        upper.neighbours[first..].sort_unstable();
        upper.starts.push(upper.neighbours.len() as u32);
    }
    upper
}

/// Returns the pattern of the upper triangle in compressed columns, with every node widened to `D` unknowns.
fn pattern<const D: usize>(upper: &Graph) -> Result<SymbolicSparseColMat<u32>, SparseError> {
    let unknowns = upper.n_nodes() * D;
    let entries = D * D * upper.neighbours.len() + upper.n_nodes() * D * (D + 1) / 2;
    if u32::try_from(entries).is_err() {
        return Err(too_large(unknowns, format!("{entries} entries")));
    }
    let d = D as u32;
    let mut starts = Vec::with_capacity(unknowns + 1);
    let mut rows = Vec::with_capacity(entries);
    starts.push(0);
    for node in 0..upper.n_nodes() as u32 {
        for c in 0..d {
            for &k in upper.neighbours(node) {
                rows.extend((0..d).map(|r| k * d + r));
            }
            rows.extend((0..=c).map(|r| node * d + r));
            starts.push(rows.len() as u32);
        }
    }
    Ok(SymbolicSparseColMat::new_checked(unknowns, unknowns, starts, None, rows))
}

#[cfg(test)]
mod tests;
