//! Fields over the plate: values on a regular grid, the output of comparisons.

/// Field on a regular grid over the whole plate, v outer, u inner.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Name, e.g. `displacement`.
    pub name: String,
    /// Unit, e.g. `m`.
    pub unit: String,
    /// Nodes along u and v.
    pub nodes: [usize; 2],
    /// Numbers per node.
    pub components: usize,
    /// `nodes[0] * nodes[1] * components` numbers, components innermost; those of a node without data are meaningless.
    pub values: Vec<f64>,
    /// One state per node.
    pub state: Vec<NodeState>,
}

/// State of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum NodeState {
    /// Not seen.
    Unseen = 0,
    /// Seen, with a value.
    Seen = 1,
    /// Seen, with a value below the level of detection.
    Unchanged = 2,
}

impl From<bool> for NodeState {
    /// Returns the state of a node that was seen (true) or not (false).
    fn from(seen: bool) -> Self {
        if seen { Self::Seen } else { Self::Unseen }
    }
}

impl Field {
    /// Returns one component at a position given as shares of the plate's sides (0 to 1): interpolated bilinearly
    /// between the seen nodes, with the state of the nearest one.
    #[must_use]
    pub fn sample(&self, u: f64, v: f64, component: usize) -> (NodeState, f64) {
        let [n_u, n_v] = self.nodes;
        let place = |share: f64, n: usize| {
            let at = share.clamp(0.0, 1.0) * n.saturating_sub(1) as f64;
            let from = (at as usize).min(n.saturating_sub(2));
            (from, (from + 1).min(n.saturating_sub(1)), at - from as f64)
        };
        let ((i0, i1, f), (k0, k1, g)) = (place(u, n_u), place(v, n_v));
        let nearest = (if g >= 0.5 { k1 } else { k0 }) * n_u + if f >= 0.5 { i1 } else { i0 };
        let (mut weights, mut sum) = (0.0, 0.0);
        for (node, weight) in [
            (k0 * n_u + i0, (1.0 - f) * (1.0 - g)),
            (k0 * n_u + i1, f * (1.0 - g)),
            (k1 * n_u + i0, (1.0 - f) * g),
            (k1 * n_u + i1, f * g),
        ] {
            if self.state[node] != NodeState::Unseen {
                weights += weight;
                sum += weight * self.values[node * self.components + component];
            }
        }
        (self.state[nearest], if weights > 0.0 { sum / weights } else { 0.0 })
    }
}
