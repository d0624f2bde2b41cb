//! Strips of background beside an edge that are narrower than a beam, such as the foot of a wall or a table's top.
//!
//! A mixed pixel behind the plane of such a strip sees the far edge of the strip, and not necessarily the plate. A
//! strip is taken to be present at a lattice line if neighbouring lattice lines end on its plane, on both sides of that
//! line along the columns or along the rows. If they do so on one side only, the strip ends there. Lines of other edges
//! count too, since a strip may continue around a corner.
//!
//! In: the lattice lines of the edges, and the planes between face and background along each line
//! (`extract/background_planes`). Out: the lines beside a strip. Own.
//!
//! Limit: where no beam lies fully on the strip over more than [`REACH`] columns or rows, the strip is detected by the
//! footprint of its edge alone (`edge`).

use super::lattice_line::LatticeLine;

/// Number of columns and rows over which a strip is taken to continue.
const REACH: u32 = 48;

/// Least number of lattice lines on either side that end on the strip's plane: one line in a hundred ends on a plane by
/// chance.
const LEAST: usize = 3;

/// Returns, for each edge, the numbers of its lines that are beside a strip.
pub(super) fn shown(edges: [&[LatticeLine]; 4]) -> [Vec<usize>; 4] {
    let shows = |line: &LatticeLine, plane: u8| {
        let on_plane = edges.into_iter().flatten().filter(|other| other.background == Some(plane));
        let mut sides = [[0; 2]; 2];
        for other in on_plane.filter(|other| is_near(line, other)) {
            for (k, [before, behind]) in sides.iter_mut().enumerate() {
                *before += usize::from(other.place[k] < line.place[k]);
                *behind += usize::from(other.place[k] > line.place[k]);
            }
        }
        sides.iter().any(|both| both.iter().all(|count| *count >= LEAST))
    };
    let is_beside = |line: &LatticeLine| line.strips.numbers().any(|plane| shows(line, plane));
    edges.map(|lines| (0..lines.len()).filter(|at| is_beside(&lines[*at])).collect())
}

/// Returns true when two lines end within [`REACH`] of each other.
fn is_near(one: &LatticeLine, other: &LatticeLine) -> bool {
    one.place.iter().zip(&other.place).all(|(one, other)| one.abs_diff(*other) <= REACH)
}

#[cfg(test)]
mod tests {
    use super::super::lattice_line::tests::open_line;
    use super::*;
    use crate::extract::PlaneSet;

    /// Lines of which every second has a mixed pixel that may be behind a strip of plane 2; some of the others end on
    /// that plane.
    fn lines(ends_on_it: impl Fn(u32) -> bool) -> Vec<LatticeLine> {
        let line = |k: u32| {
            let is_mixed = k.is_multiple_of(2);
            let strips: PlaneSet = is_mixed.then_some(2).into_iter().collect();
            let background = (!is_mixed && ends_on_it(k)).then_some(2);
            let mut line = open_line(None);
            (line.strips, line.background) = (strips, background);
            (line.along, line.place) = (5e-3 * f64::from(k), [k, 0]);
            line
        };
        (0..200).map(line).collect()
    }

    #[test]
    fn a_strip_goes_on_between_places_that_show_it_on_both_sides() {
        let shown = |ends_on_it: &dyn Fn(u32) -> bool| {
            let [shown, ..] = shown([&lines(ends_on_it), &[], &[], &[]]);
            shown
        };
        // The strip is visible up to line 60 and from line 100 on.
        let gap = shown(&|k| !(60..100).contains(&k));
        assert!((6..194).step_by(2).all(|k| gap.contains(&k)), "{gap:?}");
        // The strip ends at line 60.
        let end = shown(&|k| k < 60);
        assert!((6..54).step_by(2).all(|k| end.contains(&k)) && !end.iter().any(|k| *k >= 60), "{end:?}");
        assert!(shown(&|k| k == 51 || k == 151).is_empty());
    }
}
