//! Strips of background beside an edge that are narrower than a beam, such as the foot of a wall or a table's top.
//!
//! A mixed pixel behind the plane of such a strip sees the far edge of the strip, and not necessarily the plate. A
//! strip is taken to be present at a lattice line if neighbouring lattice lines end on its plane, on both sides of that
//! line along the columns or along the rows. If they do so on one side only, the strip ends there, unless it is one cell
//! wide: such a strip tapers off and continues, narrower than a beam, beyond the last line that ends on it. Lines of
//! other edges count too, since a strip may continue around a corner.
//!
//! Where no beam lies fully on the strip over more than [`REACH`] columns or rows, two signs of it are left once the edge
//! is fitted (`edge`): a footprint far larger than that of the other edges, and mixed pixels farther outside of the edge
//! than a footprint reaches.
//!
//! In: the lattice lines of the edges, and the planes between face and background along each line
//! (`extract/background_planes`). Out: the lines beside a strip. Own.
//!
//! Limit: a strip so narrow that it shows neither sign is taken for the background behind it.

use super::lattice_line::LatticeLine;

/// Number of columns and rows over which a strip is taken to continue.
const REACH: u32 = 48;

/// Least number of lattice lines on either side that end on the strip's plane: one line in a hundred ends on a plane by
/// chance.
const LEAST: usize = 3;

/// Least number of lines on one side that end on a single cell of the plane. With 3, 65 of 300 scenes without a strip
/// differ by more than 0.02 mm, with 6 it is 12.
const LEAST_NARROW: usize = 6;

/// Distance outside of an edge beyond which a mixed pixel does not see it, in footprints.
const OUTSIDE: f64 = 1.25;

/// Least number of columns or of rows over which such pixels extend: where the outline of an object behind the plate
/// meets the edge they extend over 3.
const LONG: u32 = 6;

/// Returns, for each edge, the numbers of its lines that are beside a strip.
pub(super) fn shown(edges: [&[LatticeLine]; 4]) -> [Vec<usize>; 4] {
    let shows = |line: &LatticeLine, plane: u8| {
        let on_plane = edges.into_iter().flatten().filter(|other| other.background == Some(plane));
        let near: Vec<&LatticeLine> = on_plane.filter(|other| is_near(line, other)).collect();
        let narrow = near.iter().copied().filter(|other| other.narrow);
        sides(line, near.iter().copied()).iter().any(|both| both.iter().all(|count| *count >= LEAST))
            || sides(line, narrow).iter().flatten().any(|count| *count >= LEAST_NARROW)
    };
    let is_beside = |line: &LatticeLine| line.strips.numbers().any(|plane| shows(line, plane));
    edges.map(|lines| (0..lines.len()).filter(|at| is_beside(&lines[*at])).collect())
}

/// Returns the numbers of the lines of an edge that are near mixed pixels which do not see it: such pixels lie farther
/// outside than a footprint reaches, and therefore see the far edge of a strip. `edge` is the edge as fitted to all
/// lines, `footprint` half the angle that a beam sees, radians.
pub(super) fn near_far_edges(lines: &[LatticeLine], edge: impl Fn(f64) -> f64, footprint: f64) -> Vec<usize> {
    let is_far = |line: &&LatticeLine| {
        let least = edge(line.along) - OUTSIDE * footprint * line.per_radian;
        line.has_odds() && line.mixed.is_some_and(|(at, _)| at < least)
    };
    let is_doubtful = |line: &&LatticeLine| !line.strips.is_empty();
    let far: Vec<&LatticeLine> = lines.iter().filter(is_doubtful).filter(is_far).collect();
    let is_beside = |line: &LatticeLine| {
        let near: Vec<&LatticeLine> = far.iter().copied().filter(|other| is_near(line, other)).collect();
        near.len() >= LEAST && LatticeLine::extent(near).iter().any(|count| *count >= LONG)
    };
    (0..lines.len()).filter(|at| is_doubtful(&&lines[*at]) && is_beside(&lines[*at])).collect()
}

/// Counts the lines before and behind a line, along the columns and along the rows.
fn sides<'a>(line: &LatticeLine, others: impl Iterator<Item = &'a LatticeLine>) -> [[usize; 2]; 2] {
    let mut counts = [[0; 2]; 2];
    for other in others {
        for (k, [before, behind]) in counts.iter_mut().enumerate() {
            *before += usize::from(other.place[k] < line.place[k]);
            *behind += usize::from(other.place[k] > line.place[k]);
        }
    }
    counts
}

/// Returns true when two lines end within [`REACH`] of each other.
fn is_near(one: &LatticeLine, other: &LatticeLine) -> bool {
    one.place.iter().zip(&other.place).all(|(one, other)| one.abs_diff(*other) <= REACH)
}

#[cfg(test)]
mod tests {
    use super::super::lattice_line::tests::{one_pixel_line, open_line};
    use super::*;
    use crate::extract::PlaneSet;

    /// Lines of which every second has a mixed pixel that may be behind a strip of plane 2; some of the others end on
    /// that plane, with one cell of it or more.
    fn lines(narrow: bool, ends_on_it: impl Fn(u32) -> bool) -> Vec<LatticeLine> {
        let line = |k: u32| {
            let is_mixed = k.is_multiple_of(2);
            let strips: PlaneSet = is_mixed.then_some(2).into_iter().collect();
            let background = (!is_mixed && ends_on_it(k)).then_some(2);
            let mut line = open_line(None);
            (line.strips, line.background, line.narrow) = (strips, background, narrow);
            (line.along, line.place) = (5e-3 * f64::from(k), [k, 0]);
            line
        };
        (0..200).map(line).collect()
    }

    #[test]
    fn a_strip_goes_on_between_places_that_show_it_on_both_sides() {
        let shown = |narrow, ends_on_it: &dyn Fn(u32) -> bool| {
            let [shown, ..] = shown([&lines(narrow, ends_on_it), &[], &[], &[]]);
            shown
        };
        // The strip is visible up to line 60 and from line 100 on.
        let gap = shown(false, &|k| !(60..100).contains(&k));
        assert!((6..194).step_by(2).all(|k| gap.contains(&k)), "{gap:?}");
        // The strip ends at line 60.
        let end = shown(false, &|k| k < 60);
        assert!((6..54).step_by(2).all(|k| end.contains(&k)) && !end.iter().any(|k| *k >= 60), "{end:?}");
        // One cell wide it goes on.
        let taper = shown(true, &|k| k < 60);
        assert!((60..98).step_by(2).all(|k| taper.contains(&k)) && !taper.contains(&98), "{taper:?}");
        assert!(shown(true, &|k| k == 51 || k == 151).is_empty());
    }

    /// Lines along an edge with a footprint of 1.6 mm and a single mixed pixel each; those of every fourth column of a
    /// stretch see the far edge of a strip, 6 mm outside.
    #[test]
    fn mixed_pixels_that_do_not_see_the_edge_show_a_strip() {
        let doubted = |far: std::ops::Range<u32>| {
            let line = |k: u32| {
                let at = if far.contains(&k) && k.is_multiple_of(4) { -6e-3 } else { 0.0 };
                let mut line = one_pixel_line(at);
                (line.strips, line.place) = ([2].into_iter().collect(), [k, 0]);
                line
            };
            let lines: Vec<LatticeLine> = (0..300).map(line).collect();
            near_far_edges(&lines, |_| 0.0, 1.6e-4)
        };
        // Those within 48 columns of all three.
        assert_eq!(doubted(100..112), (60..149).collect::<Vec<usize>>());
        assert!(doubted(100..108).is_empty(), "two");
        assert!(doubted(0..0).is_empty());
    }
}
