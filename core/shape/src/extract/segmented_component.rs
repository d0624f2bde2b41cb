//! Component of the lattice with the results computed for it, in order: noise, mixed pixels, normals, faces.

use super::background_planes::{self, Background};
use super::continuity::Continuity;
use super::faces::{self, Face};
use super::mixed_pixels::{self, Pixel};
use super::occlusion::FacePiece;
use super::range_noise::Noise;
use super::smoothed_normals::{self, Normal};
use super::window::Window;

/// A component with its noise, mixed pixels, normals and faces.
#[derive(Debug, Clone)]
pub(super) struct SegmentedComponent {
    /// Root of the component, or of the first of several.
    pub(super) root: u32,
    pub(super) window: Window,
    /// Noise of the component, and of all else.
    pub(super) noise: Noise,
    pub(super) background_noise: Noise,
    pub(super) pixels: Vec<Pixel>,
    pub(super) background: Background,
    /// Number of cells on each side over which the normals' slopes are taken.
    pub(super) slope_reach: usize,
    pub(super) normals: Vec<Normal>,
    labels: Vec<u32>,
    faces: Vec<Face>,
}

impl SegmentedComponent {
    pub(super) fn of(root: u32, window: Window, continuity: &Continuity) -> Self {
        let noise = Noise::estimate(&window, &window.own);
        let background_noise = Noise::of_background(&window);
        let mut pixels = mixed_pixels::classify(&window, &noise, &background_noise);
        let background = background_planes::mark_sound(&window, &noise, &mut pixels);
        let usable: Vec<bool> =
            window.own.iter().zip(&pixels).map(|(own, pixel)| *own && *pixel != Pixel::Mixed).collect();
        let smooth = smoothed_normals::low_pass(&window, &usable, continuity);
        let slope_reach = smoothed_normals::slope_reach(&window, noise.pooled);
        let normals = smoothed_normals::normals(&window, &smooth, &usable, slope_reach);
        let (labels, faces) = faces::find_faces(&window, &normals, slope_reach);
        Self {
            root,
            window,
            noise,
            background_noise,
            pixels,
            background,
            slope_reach,
            normals,
            labels,
            faces,
        }
    }

    /// Returns the faces of at least `least` square metres. `number` is that of this component, for
    /// [`FacePiece::surface`].
    pub(super) fn pieces(&self, number: usize, least: f64) -> impl Iterator<Item = FacePiece> {
        let notable = self.faces.iter().filter(move |face| face.area >= least);
        notable.map(move |face| FacePiece::new(number, &self.window, &self.labels, face, &self.normals))
    }

    /// Returns the mean distance of neighbouring beams, across them, metres.
    pub(super) fn spacing(&self) -> f64 {
        let own = self.window.own.iter().zip(&self.window.cells).filter(|(own, _)| **own);
        let (n, sum) = own.fold((0, 0.0), |(n, sum), (_, cell)| (n + 1, sum + f64::from(cell.range_m)));
        let header = &self.window.header;
        sum / f64::from(n.max(1)) * (header.azimuth_step * header.elevation_step).sqrt()
    }

    /// Returns the cells of a face as cells of another window that contains this one.
    pub(super) fn region(&self, label: u32, into: &Window) -> Vec<bool> {
        let mut region = vec![false; into.cells.len()];
        let columns = (self.window.first_column - into.first_column) as usize;
        let rows = (self.window.first_row - into.first_row) as usize;
        for (cell, _) in self.labels.iter().enumerate().filter(|(_, l)| **l == label) {
            let (column, row) = (cell / self.window.n_rows, cell % self.window.n_rows);
            region[(column + columns) * into.n_rows + row + rows] = true;
        }
        region
    }
}
