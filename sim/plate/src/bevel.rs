//! Double-V bevelled edges: how far each height of a side face lies inside of the mid-surface's edge.
//!
//! A bevelled edge has three strips: a flank below the upper face, a square root face in the middle, and a flank above
//! the underside. A square edge has one strip.

use crate::Blank;

/// Strip of a side face: a plane over heights `from` to `to` above the mid-surface, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strip {
    /// Lowest height.
    pub from: f64,
    /// Highest height.
    pub to: f64,
    /// Distance inwards at height 0 of the strip's plane, metres.
    pub offset: f64,
    /// Growth of that distance with height.
    pub slope: f64,
}

impl Strip {
    /// Returns the distance inside of the mid-surface's edge at a height, metres.
    #[must_use]
    pub fn inset(&self, height: f64) -> f64 {
        self.offset + self.slope * height
    }
}

/// Returns the strips of a blank's side faces: the upright one first, if there is one, then the upper and the lower
/// flank.
pub(crate) fn strips(blank: &Blank) -> Vec<Strip> {
    let half = 0.5 * (blank.thickness_mm * 1e-3);
    let (inset, root) = (blank.face_inset_mm * 1e-3, 0.5 * (blank.root_face_mm * 1e-3));
    if inset == 0.0 {
        return vec![Strip { from: -half, to: half, offset: 0.0, slope: 0.0 }];
    }
    let slope = inset / (half - root);
    let offset = -slope * root;
    let upright = (root > 0.0).then_some(Strip { from: -root, to: root, offset: 0.0, slope: 0.0 });
    let upper = Strip { from: root, to: half, offset, slope };
    let lower = Strip { from: -half, to: -root, offset, slope: -slope };
    upright.into_iter().chain([upper, lower]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_meet_and_end_in_the_face() {
        let blank = Blank { thickness_mm: 36.0, face_inset_mm: 9.0, root_face_mm: 4.0, ..Blank::default() };
        let [root, upper, lower] = strips(&blank)[..] else { panic!("three strips") };
        for (strip, height, inset) in [
            (root, 0.002, 0.0),
            (upper, 0.002, 0.0),
            (upper, 0.018, 0.009),
            (lower, -0.002, 0.0),
            (lower, -0.018, 0.009),
        ] {
            assert!((strip.inset(height) - inset).abs() < 1e-15, "{strip:?} at {height}");
        }
        assert_eq!((root.from, root.to), (-upper.from, upper.from));
        assert_eq!(strips(&Blank { root_face_mm: 0.0, ..blank.clone() }).len(), 2);
        let [square] = strips(&Blank { face_inset_mm: 0.0, root_face_mm: 0.0, ..blank })[..] else {
            panic!("one strip")
        };
        assert_eq!((square.from, square.inset(0.01)), (-square.to, 0.0));
    }
}
