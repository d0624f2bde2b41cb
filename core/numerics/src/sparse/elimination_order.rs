//! Elimination order by geometric nested dissection (George, SIAM J. Numer. Anal. 10 (1973)).
//!
//! The nodes are divided into two halves at the median of their longer extent. The nodes of one half that are
//! neighbours of the other form the separator and are eliminated last; each half is ordered in the same way. On plane
//! meshes the separators are short, so that the factor is sparser and quicker to find than by minimum degree.

use super::Graph;

/// Largest size of a part that is not divided but eliminated along its longer extent. Larger leaves are quicker to
/// order, but 48 gives an eighth more fill (benchmarks of the flattening plugins).
const LEAF: usize = 20;

/// Returns the nodes of `graph` in elimination order. `points` has one point per node.
pub(super) fn nested_dissection(graph: &Graph, points: &[[f64; 2]]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..graph.n_nodes() as u32).collect();
    let mut dissection = Dissection { graph, points, half: vec![0; order.len()], halves: 0 };
    dissection.order(&mut order);
    order
}

struct Dissection<'a> {
    graph: &'a Graph,
    points: &'a [[f64; 2]],
    /// Number of the upper half to which a node was last assigned; numbers are never reused.
    half: Vec<u32>,
    halves: u32,
}

impl Dissection<'_> {
    fn order(&mut self, nodes: &mut [u32]) {
        let axis = self.longer_extent(nodes);
        let points = self.points;
        let along = |a: &u32, b: &u32| {
            points[*a as usize][axis].total_cmp(&points[*b as usize][axis]).then_with(|| a.cmp(b))
        };
        if nodes.len() <= LEAF {
            nodes.sort_unstable_by(along);
            return;
        }
        let middle = nodes.len() / 2;
        nodes.select_nth_unstable_by(middle, along);
        self.halves += 1;
        for &node in &nodes[middle..] {
            self.half[node as usize] = self.halves;
        }
        let inner = self.move_separator_to_end(&mut nodes[..middle]);
        let separator = middle - inner;
        nodes[inner..].rotate_left(separator);
        let (first, rest) = nodes.split_at_mut(inner);
        let (second, last) = rest.split_at_mut(rest.len() - separator);
        self.order(first);
        self.order(second);
        last.sort_unstable_by(|a, b| {
            points[*a as usize][1 - axis].total_cmp(&points[*b as usize][1 - axis]).then_with(|| a.cmp(b))
        });
    }

    fn longer_extent(&self, nodes: &[u32]) -> usize {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for &node in nodes {
            let point = self.points[node as usize];
            for axis in 0..2 {
                low[axis] = low[axis].min(point[axis]);
                high[axis] = high[axis].max(point[axis]);
            }
        }
        usize::from(high[1] - low[1] > high[0] - low[0])
    }

    /// Moves the nodes that are neighbours of the current upper half behind the others; returns the number of others.
    fn move_separator_to_end(&self, lower: &mut [u32]) -> usize {
        let touches =
            |node: u32| self.graph.neighbours(node).iter().any(|&k| self.half[k as usize] == self.halves);
        let mut inner = 0;
        for at in 0..lower.len() {
            if !touches(lower[at]) {
                lower.swap(inner, at);
                inner += 1;
            }
        }
        inner
    }
}
