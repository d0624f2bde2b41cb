//! Coverage of an edge: the stretches along it where it was seen.

/// An edge counts as seen where a crossing lies within this many lattice steps.
const STEPS: f64 = 6.0;

/// Places along an edge of the crossings that belong to it.
#[derive(Debug, Clone)]
pub(super) struct Coverage {
    /// Sorted.
    places: Vec<f64>,
    /// Distance around a place within which the edge counts as seen, metres.
    reach: f64,
}

impl Coverage {
    /// Collects the places; `step` is the spacing of samples, metres.
    pub(super) fn new(places: impl Iterator<Item = f64>, step: f64) -> Self {
        let mut places: Vec<f64> = places.collect();
        places.sort_by(f64::total_cmp);
        Self { places, reach: STEPS * step }
    }

    /// Returns true when the edge was seen at a place along it.
    pub(super) fn at(&self, along: f64) -> bool {
        let next = self.places.partition_point(|place| *place < along - self.reach);
        self.places.get(next).is_some_and(|place| *place <= along + self.reach)
    }

    /// Returns the part of the edge between two places that was seen, 0 to 1.
    pub(super) fn share(&self, from: f64, to: f64) -> f64 {
        const PLACES: usize = 200;
        let place = |i: usize| from + (to - from) * (i as f64 + 0.5) / PLACES as f64;
        (0..PLACES).filter(|&i| self.at(place(i))).count() as f64 / PLACES as f64
    }
}
