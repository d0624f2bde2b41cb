//! Map of a field over the plate's rectangle (u, v).

mod layout;
mod legend;
mod marks;

use platen_model::Field;

use super::canvas::{Canvas, draw};
use super::{Caption, PictureError, PictureScale, View};
use crate::result::{Next, NextPlace, PlateRecord};
pub(super) use layout::{Layout, Look, SQUARE};

/// Mark of the next action, on the map of the missing curvature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark<'a> {
    /// Place of the next hit, drawn as a frame.
    Place(&'a NextPlace),
    /// Advised bend line: its ends (u, v), and the largest expected distance of the bend from it, millimetres, drawn as
    /// an outline.
    Line([[f64; 2]; 2], Option<f64>),
}

impl<'a> Mark<'a> {
    /// Returns the mark of a result's next place.
    #[must_use]
    pub fn of(next: Option<&'a Next>) -> Option<Self> {
        next.and_then(Next::place).map(Self::Place)
    }
}

/// Layout in files and reports.
const LOOK: Look =
    Look { left: 112.0, top: 128.0, below: 92.0, letters: 1.0, press_line: 56.0, title_line: 56.0 };

/// Draws one field over the plate. The map of the missing curvature frames the place of the next hit.
///
/// # Errors
/// The drawing library fails.
pub fn map(
    field: &Field,
    plate: &PlateRecord,
    caption: &Caption<'_>,
    picture_scale: &PictureScale,
    next: Option<&Next>,
) -> Result<String, PictureError> {
    let layout = Layout::new(field, plate, picture_scale, View::FILE, LOOK);
    draw(layout.size(), |canvas| {
        canvas.head(caption, &layout.title, layout.view.language)?;
        let (from, to) = layout.corners();
        layout.shades(field).paint(canvas, from, to)?;
        words(&layout, field, Mark::of(next), canvas)
    })
}

/// Draws everything that lies over the colours or beside them.
pub(super) fn words(
    layout: &Layout<'_>,
    field: &Field,
    mark: Option<Mark<'_>>,
    canvas: &Canvas<'_>,
) -> Result<(), PictureError> {
    layout.axes(canvas)?;
    marks::next(mark, field, layout, canvas)?;
    marks::part_means(field, layout, canvas)?;
    legend::draw(field, layout, canvas)
}

#[cfg(test)]
mod tests {
    use platen_model::{NodeState, Verdict};

    use super::*;
    use crate::result::{CURVATURE_DEFICIT, NoNext};

    const SIDE: usize = 21;

    fn field(name: &str, unit: &str, value: impl Fn(f64, f64) -> f64, hole: bool) -> Field {
        let at = |k: usize| ((k % SIDE) as f64 / (SIDE - 1) as f64, (k / SIDE) as f64 / (SIDE - 1) as f64);
        let state = |(u, v): (f64, f64)| match hole && (u - 0.5).hypot(v - 0.5) < 0.2 {
            true => NodeState::Unseen,
            false => NodeState::Seen,
        };
        Field {
            name: name.into(),
            unit: unit.into(),
            nodes: [SIDE, SIDE],
            components: 1,
            values: (0..SIDE * SIDE).map(at).map(|(u, v)| value(u, v)).collect(),
            state: (0..SIDE * SIDE).map(at).map(state).collect(),
        }
    }

    fn drawn(field: &Field) -> String {
        framed(field, None)
    }

    fn framed(field: &Field, next: Option<&Next>) -> String {
        let plate = PlateRecord { width_mm: 3000.0, height_mm: 2500.0, ..PlateRecord::default() };
        let caption = Caption { plate: "A<7>", stroke: Some(7), verdict: Verdict::Fail };
        let picture_scale = PictureScale { limit_mm: 3.0, chord_mm: 2000.0, bend_per_m: 0.1 };
        map(field, &plate, &caption, &picture_scale, next).unwrap()
    }

    /// Returns the part of the picture that contains the legend's numbers.
    fn legend(svg: &str) -> Vec<&str> {
        svg.lines().filter(|line| line.contains('+') || line.contains('\u{2212}')).collect()
    }

    #[test]
    fn the_plates_name_cannot_break_the_picture() {
        assert!(drawn(&field("deviation", "m", |u, _| u, false)).contains("A&lt;7&gt;"));
    }

    #[test]
    fn small_and_large_strokes_have_the_same_legend() {
        let [small, large] = [1e-3, 1e-1].map(|size| drawn(&field("deviation", "m", |u, _| -size * u, true)));
        for number in ["+3.0", "+150", "\u{2212}150"] {
            assert!(legend(&small).contains(&number) && legend(&large).contains(&number), "{number}");
        }
    }

    #[test]
    fn what_was_not_seen_is_hatched_and_named() {
        let whole = drawn(&field("deviation", "m", |u, _| u, false));
        let holed = drawn(&field("deviation", "m", |u, _| u, true));
        assert!(!whole.contains("no data") && holed.contains("no data"));
        let hatches = |svg: &str| svg.matches("#6E7278").count();
        assert!(hatches(&holed) > hatches(&whole) + 20, "{} {}", hatches(&holed), hatches(&whole));
    }

    #[test]
    fn the_place_of_the_next_hit_is_framed_on_the_map_of_the_missing_curvature_alone() {
        let next = Next::Place(NextPlace {
            at_mm: [2000.0, 1000.0],
            extent_mm: [600.0, 800.0],
            gap_mm: 20.0,
            uncertainty_mm: None,
            limit_mm: 3.0,
            chord_mm: 2000.0,
        });
        let deficit = field(CURVATURE_DEFICIT, "1/m", |_, _| 0.04, false);
        // 808 x 672 pixels, 8 units a pixel; u from the left, v from below.
        let corner = |u: f64, v: f64| {
            let (x, y) = (LOOK.left + 808.0 * u / 3000.0, LOOK.top + 672.0 * (1.0 - v / 2500.0));
            let [x, y] = [x, y].map(|pixel| (8.0 * pixel).round());
            format!("{x},{y}")
        };
        let svg = framed(&deficit, Some(&next));
        for place in [corner(1700.0, 600.0), corner(2300.0, 600.0), corner(1700.0, 1400.0)] {
            assert!(svg.contains(&place), "{place}");
        }
        assert!(svg.contains("next hit"));
        for other in [
            framed(&deficit, None),
            framed(&deficit, Some(&Next::Nowhere { none: NoNext::NothingStandsOut })),
            framed(&field("deviation", "m", |_, _| 0.04, false), Some(&next)),
        ] {
            assert!(!other.contains("next hit") && !other.contains(&corner(1700.0, 600.0)));
        }
    }
}
