//! Faces of a component: region growing on the normals of its low-pass copy.

use nalgebra::Vector3;

use super::window::Window;

/// Label of a cell that is part of no face.
pub(super) const NO_FACE: u32 = u32::MAX;

/// Largest angle between the normals some cells before and behind a cell of a face, radians. Across an edge
/// between two faces the low-pass copy turns by 90 degrees over about six cells; a plate bent to R 2 m turns by less
/// than 1 degree over four cells of 6 mm, by 5 at the most grazing sight; noise adds a few.
const MAX_TURN: f32 = 0.2;

/// Cells on each side over which the turn is taken, at least; as many as slopes are taken over.
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
pub(super) fn faces(window: &Window, normals: &[Vector3<f32>], slope_reach: usize) -> (Vec<u32>, Vec<Face>) {
    let n_rows = window.n_rows;
    let flat = flat(normals, n_rows, slope_reach.max(LEAST_STRIDE));
    let mut label = vec![NO_FACE; normals.len()];
    let mut faces: Vec<Face> = Vec::new();
    let mut front = Vec::new();
    for seed in 0..normals.len() {
        if label[seed] != NO_FACE || !flat[seed] {
            continue;
        }
        let number = faces.len() as u32;
        let mut face = Face { label: number, area: 0.0, n_cells: 0 };
        label[seed] = number;
        front.push(seed);
        while let Some(at) = front.pop() {
            face.area += area(window, at, &normals[at]);
            face.n_cells += 1;
            for next in [at - 1, at + 1, at - n_rows, at + n_rows] {
                if flat[next] && label[next] == NO_FACE {
                    label[next] = number;
                    front.push(next);
                }
            }
        }
        faces.push(face);
    }
    faces.sort_by(|a, b| b.area.total_cmp(&a.area).then(a.label.cmp(&b.label)));
    (label, faces)
}

/// Cells that have a normal and around which it does not turn. Margins of the window never are.
fn flat(normals: &[Vector3<f32>], n_rows: usize, stride: usize) -> Vec<bool> {
    let cos_turn = MAX_TURN.cos();
    let reach = stride * n_rows;
    let none = Vector3::zeros();
    let turns = |a: usize, b: usize| {
        normals[a] != none && normals[b] != none && normals[a].dot(&normals[b]) < cos_turn
    };
    let mut flat = vec![false; normals.len()];
    for at in reach..normals.len().saturating_sub(reach) {
        flat[at] = normals[at] != none && !turns(at - stride, at + stride) && !turns(at - reach, at + reach);
    }
    flat
}

/// Area of the surface that a cell stands for.
fn area(window: &Window, index: usize, normal: &Vector3<f32>) -> f64 {
    let sight = window.nominal(index / window.n_rows, index % window.n_rows);
    let cos_incidence = -sight.unit().dot(&normal.cast()).min(-0.05);
    let range = f64::from(window.cells[index].range_m);
    let steps = window.header.azimuth_step * sight.elevation.cos * window.header.elevation_step;
    range * range * steps / cos_incidence
}
