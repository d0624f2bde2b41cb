//! Smooth faces of a component, by region growing on normals (Masuda et al., 3.1).
//!
//! A face is a connected component of the cells around which the normal of the low-pass copy does not turn. In: the
//! normals of a window. Out: the face of each cell, and the area of each face in square metres.

use super::connected_components::{NO_LABEL, label_components};
use super::smoothed_normals::{Normal, cos_between};
use super::window::Window;
use crate::Vec3;

/// Largest angle between the normals a few cells before and behind a cell of a face, radians. Across an edge between
/// two faces the low-pass copy turns by 90 degrees over about six cells. A plate bent to R 2 m turns by less than 1
/// degree over four cells of 6 mm, by 5 degrees at the most grazing incidence; noise adds a few degrees.
const MAX_TURN: f32 = 0.2;

/// Least number of cells on each side over which the turn is taken; otherwise as many as slopes are taken over.
const LEAST_STRIDE: usize = 2;

/// A face of a component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Face {
    pub(super) label: u32,
    /// Area of the surface, square metres.
    pub(super) area: f64,
    pub(super) n_cells: usize,
}

/// Labels the cells of a window by face and lists the faces, the largest first. `slope_reach` is that of the normals.
pub(super) fn find_faces(window: &Window, normals: &[Normal], slope_reach: usize) -> (Vec<u32>, Vec<Face>) {
    let n_rows = window.n_rows;
    let flat = flat(window, normals, slope_reach.max(LEAST_STRIDE));
    let (label, n) = label_components(&flat, n_rows);
    let mut faces: Vec<Face> = (0..n as u32).map(|label| Face { label, area: 0.0, n_cells: 0 }).collect();
    for (column, rows) in window.inner_spans(0) {
        for (cell, row) in (column * n_rows + rows.start..).zip(rows) {
            if label[cell] != NO_LABEL {
                let face = &mut faces[label[cell] as usize];
                face.area += area(window, column, row, &normals[cell]);
                face.n_cells += 1;
            }
        }
    }
    faces.sort_by(|a, b| b.area.total_cmp(&a.area).then(a.label.cmp(&b.label)));
    (label, faces)
}

/// Marks the cells that have a normal and around which it does not turn. Margins of the window are not marked.
fn flat(window: &Window, normals: &[Normal], stride: usize) -> Vec<bool> {
    let cos_turn = MAX_TURN.cos();
    let reach = stride * window.n_rows;
    let turns = |a: usize, b: usize| cos_between(&normals[a], &normals[b]).is_some_and(|cos| cos < cos_turn);
    let mut flat = vec![false; normals.len()];
    for (column, rows) in window.inner_spans(stride) {
        for at in column * window.n_rows + rows.start..column * window.n_rows + rows.end {
            flat[at] = normals[at] != Normal::default()
                && !turns(at - stride, at + stride)
                && !turns(at - reach, at + reach);
        }
    }
    flat
}

/// Returns the area of the surface that a cell stands for.
fn area(window: &Window, column: usize, row: usize, normal: &Normal) -> f64 {
    let beam = window.nominal(column, row);
    let cos_incidence = -beam.unit().dot(&Vec3::from(normal.map(f64::from))).min(-0.05);
    let range = f64::from(window.cells[column * window.n_rows + row].range_m);
    let steps = window.header.azimuth_step * beam.elevation.cos * window.header.elevation_step;
    range * range * steps / cos_incidence
}
