//! Disjoint sets: what hangs together, as it is found.

/// The numbers 0, 1, 2, .. in sets; a set is known by one of its numbers, its root.
#[derive(Debug, Clone, Default)]
pub(crate) struct Disjoint {
    /// Nearer to the root; the root's own number.
    above: Vec<u32>,
}

impl Disjoint {
    /// `n` numbers, each in a set of its own.
    pub(crate) fn of(n: usize) -> Self {
        Self { above: (0..n as u32).collect() }
    }

    /// Adds the next number, in a set of its own, and returns it.
    pub(crate) fn push(&mut self) -> u32 {
        let number = self.above.len() as u32;
        self.above.push(number);
        number
    }

    /// Root of the set that a number is in. Halves the way to it.
    pub(crate) fn root(&mut self, mut number: u32) -> u32 {
        while self.above[number as usize] != number {
            let above = self.above[number as usize];
            self.above[number as usize] = self.above[above as usize];
            number = above;
        }
        number
    }

    /// Puts the sets of two numbers together under the lower root; `(lower, higher)` root when they were apart.
    pub(crate) fn join(&mut self, a: u32, b: u32) -> Option<(u32, u32)> {
        let (a, b) = (self.root(a), self.root(b));
        let (lower, higher) = (a.min(b), a.max(b));
        self.above[higher as usize] = lower;
        (lower != higher).then_some((lower, higher))
    }
}
