//! Faces joined across an occlusion, by curve continuation on the lattice lines that cross both.
//!
//! A chain or the ram in front of the plate can cut its face into several components. Two pieces are one face when, on
//! most rows or columns that contain both, one smooth curve leads from one piece to the other, and the cells between
//! them are nearer than both or were not measured. The same holds for the two sides of the seam of the scanner's faces,
//! where warm-up columns are left out.
//!
//! In: the faces of the components. Out: whether two pieces belong to one face. Own; Masuda et al. assume an
//! unobstructed plate.

use super::faces::Face;
use super::smoothed_normals::Normal;
use super::window::Window;
use crate::Vec3;

/// Number of cells from a piece's end to the cell whose normal is taken.
const INSET: usize = 3;

/// Least number of lines (rows or columns) that must contain both pieces, and the part of them that must agree.
const LEAST_LINES: usize = 8;
const AGREEING: f64 = 0.6;

/// Smallest radius of curvature across a hidden strip, metres, and the error of an angle due to noise, radians.
const LEAST_RADIUS: f64 = 2.0;
const ANGLE_NOISE: f64 = 0.06;

/// Largest distance of an end from the curve, metres. The scanner's two faces disagree by millimetres; where few
/// columns are left out at their seam, this and the noise of a single sample turn the chord by far more than
/// [`ANGLE_NOISE`]. The least thickness of a plate that lies on another one is far larger.
const STEP: f64 = 3e-3;

/// Widest hidden strip, metres.
const WIDEST_STRIP: f64 = 1.5;

/// One end of a piece on a line of the lattice.
#[derive(Debug, Clone, Copy)]
struct End {
    /// Column on a row, row on a column.
    place: u32,
    point: Vec3,
    normal: Vec3,
    /// True when one of the next [`INSET`] cells is nearer, or none of them was measured.
    hidden: bool,
    /// Number of cells directly next to it that were not measured, up to [`INSET`].
    unmeasured: u32,
}

/// A face of one component, with its ends on all rows and columns.
#[derive(Debug, Clone)]
pub(super) struct FacePiece {
    /// Number of the component of which it is a face.
    pub(super) surface: usize,
    pub(super) label: u32,
    pub(super) area: f64,
    pub(super) n_cells: usize,
    /// Share of its ends on rows and columns beside which an object is nearer, or nothing was measured.
    pub(super) hidden: f64,
    /// Points on the piece that give its extent: its ends on every fourth row and column.
    pub(super) outline: Vec<Vec3>,
    rows: Ends,
    columns: Ends,
}

/// First and last end on the lines from `first` on.
#[derive(Debug, Clone)]
struct Ends {
    first: u32,
    ends: Vec<Option<[End; 2]>>,
}

impl FacePiece {
    pub(super) fn new(
        surface: usize,
        window: &Window,
        labels: &[u32],
        face: &Face,
        normals: &[Normal],
    ) -> Self {
        let lines = |rows: bool| lines(window, labels, face.label, normals, rows);
        let (rows, columns) = (lines(true), lines(false));
        let outline = [&rows, &columns]
            .into_iter()
            .flat_map(|lines| lines.ends.iter().step_by(4).flatten().flat_map(|[a, b]| [a.point, b.point]));
        let outline = outline.collect();
        let ends = || [&rows, &columns].into_iter().flat_map(|lines| lines.ends.iter().flatten().flatten());
        let hidden = ends().filter(|end| end.hidden).count() as f64 / ends().count().max(1) as f64;
        let (label, area, n_cells) = (face.label, face.area, face.n_cells);
        Self { surface, label, area, n_cells, hidden, outline, rows, columns }
    }

    /// Returns true when `other` continues this piece behind a nearer object.
    pub(super) fn continues_in(&self, other: &Self) -> bool {
        agree(&self.rows, &other.rows) || agree(&self.columns, &other.columns)
    }
}

fn lines(window: &Window, labels: &[u32], label: u32, normals: &[Normal], rows: bool) -> Ends {
    let n_rows = window.n_rows;
    let (n_lines, n_places, first, offset) = if rows {
        (n_rows, window.n_columns, window.first_row, window.first_column)
    } else {
        (window.n_columns, n_rows, window.first_column, window.first_row)
    };
    let index = |line: usize, place: usize| if rows { place * n_rows + line } else { line * n_rows + place };
    // First and last place of each line, from one pass through the cells in their order in memory.
    let mut spans: Vec<Option<[usize; 2]>> = vec![None; n_lines];
    for (column, labels) in labels.chunks_exact(n_rows.max(1)).enumerate() {
        for (row, _) in labels.iter().enumerate().filter(|(_, of_cell)| **of_cell == label) {
            let (line, place) = if rows { (row, column) } else { (column, row) };
            spans[line].get_or_insert([place; 2])[1] = place;
        }
    }
    let ends = spans.into_iter().enumerate().map(|(line, span)| {
        let [low, high] = span?;
        let end = |place: usize, outward: isize| {
            let inner = place.saturating_add_signed(-outward * INSET as isize).clamp(low, high);
            let at = index(line, place);
            // A nearer object, or no return: columns that were left out, a patch without echo.
            let beside = (1..=INSET).filter_map(|far| place.checked_add_signed(outward * far as isize));
            let beside = beside.filter(|next| *next < n_places).map(|next| &window.cells[index(line, next)]);
            let near = window.cells[at].range_m - IN_FRONT;
            let hidden = beside.clone().all(|cell| !cell.valid)
                || beside.clone().any(|cell| cell.valid && cell.range_m < near);
            let unmeasured = beside.take_while(|cell| !cell.valid).count() as u32;
            let normal = Vec3::from(normals[index(line, inner)].map(f64::from));
            End { place: offset + place as u32, point: window.points[at].into(), normal, hidden, unmeasured }
        };
        Some([end(low, -1), end(high, 1)])
    });
    Ends { first, ends: ends.collect() }
}

/// Least distance of an occluding object in front of the plate, metres.
const IN_FRONT: f32 = 0.03;

fn agree(a: &Ends, b: &Ends) -> bool {
    let (mut together, mut agreeing) = (0, 0);
    for (line, ends) in (a.first..).zip(&a.ends) {
        let other = line.checked_sub(b.first).and_then(|i| b.ends.get(i as usize));
        if let (Some([a_low, a_high]), Some(Some([b_low, b_high]))) = (ends, other) {
            let facing = if a_high.place < b_low.place {
                (a_high, b_low)
            } else if b_high.place < a_low.place {
                (b_high, a_low)
            } else {
                continue;
            };
            together += 1;
            agreeing += usize::from(one_curve(facing.0, facing.1));
        }
    }
    together >= LEAST_LINES && agreeing as f64 >= AGREEING * together as f64
}

/// Returns true when a curve of nearly constant curvature leads from end `a` to end `b` farther on the same line: the
/// chord makes equal and opposite angles with the surface at both ends, within the noise and a small step between them.
fn one_curve(a: &End, b: &End) -> bool {
    let chord = b.point - a.point;
    let length = chord.norm();
    let (sin_a, sin_b) = (a.normal.dot(&chord) / length, b.normal.dot(&chord) / length);
    let turn = a.normal.angle(&b.normal);
    let step = STEP / length;
    let nothing_between = b.place - a.place == a.unmeasured + 1;
    (a.hidden && b.hidden || nothing_between)
        && length < WIDEST_STRIP
        && (sin_a + sin_b).abs() < ANGLE_NOISE + 2.0 * step
        && sin_a.abs().max(sin_b.abs()) < length / LEAST_RADIUS + ANGLE_NOISE + step
        && turn < length / LEAST_RADIUS + ANGLE_NOISE
}
