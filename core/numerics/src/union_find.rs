//! Disjoint sets by union-find: path halving, union under the lower root (Tarjan, J. ACM 22 (1975)).

/// The numbers 0, 1, 2, .. in disjoint sets; each set is represented by its lowest number, its root.
#[derive(Debug, Clone, Default)]
pub struct UnionFind {
    /// Parent of each number; a root is its own parent.
    parent: Vec<u32>,
}

impl UnionFind {
    /// Creates `n` sets of one number each.
    #[must_use]
    pub fn of(n: usize) -> Self {
        Self { parent: (0..n as u32).collect() }
    }

    /// Adds the next number as a set of its own and returns it.
    #[inline]
    pub fn push(&mut self) -> u32 {
        let number = self.parent.len() as u32;
        self.parent.push(number);
        number
    }

    /// Returns the root of the set that contains a number; halves the path to it.
    #[inline]
    pub fn find(&mut self, mut number: u32) -> u32 {
        while self.parent[number as usize] != number {
            let parent = self.parent[number as usize];
            self.parent[number as usize] = self.parent[parent as usize];
            number = parent;
        }
        number
    }

    /// Merges the sets of two numbers; returns their former roots, the lower first, when the sets were distinct.
    #[inline]
    pub fn union(&mut self, a: u32, b: u32) -> Option<(u32, u32)> {
        let (a, b) = (self.find(a), self.find(b));
        let (lower, higher) = (a.min(b), a.max(b));
        self.parent[higher as usize] = lower;
        (lower != higher).then_some((lower, higher))
    }
}
