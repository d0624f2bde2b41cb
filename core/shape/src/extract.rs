//! Extraction of the plate's scanned face: connected components, segmentation by normals, region growing.
//!
//! Input: header and columns of a scan, which arrive one by one, and the [`PlateSpec`]. Output: the [`Patch`], that is,
//! the samples on the face and the crossings of its boundary. A component is a set of lattice cells joined by the
//! continuity criterion; a face is a smooth part of a component.
//!
//! | module | step | source |
//! |---|---|---|
//! | `continuity` | criterion that joins lattice neighbours | Masuda et al., 3.1, eq. 1 and 2 |
//! | `connected_components`, `column_store` | components grown while columns arrive; cells that cannot belong to the plate are dropped | 3.1 |
//! | `completed_components`, `extent` | components of about the plate's size, evaluated as soon as they have ended | own |
//! | `window`, `beam_directions` | one component as a dense grid with its margin | |
//! | `range_noise` | noise of the range from third differences | own |
//! | `mixed_pixels` | beams that straddle an edge | own |
//! | `background_planes` | narrow strips of background distinguished from mixed pixels, by sequential RANSAC | Fischler and Bolles 1981; own |
//! | `smoothed_normals` | Taubin's low-pass filter of the inverse range and its normals | 3.1 |
//! | `faces`, `segmented_component` | smooth faces: connected components of cells where the normal does not turn | 3.1 |
//! | `occlusion` | faces joined across a nearer object | own |
//! | `plate_selection` | the candidate of the plate's size | own; Masuda et al. leave it open |
//! | `local_quadric`, `region_growing` | erosion of the face and region growing to the cell | own |
//! | `crossings` | points where rows and columns leave the face | own |
//!
//! Limits: the plate is one smooth face of known size, nearer than the background along all its edges. A component
//! whose area across the beams exceeds four times the plate's is never evaluated.

mod background_planes;
mod beam_directions;
mod column_store;
mod completed_components;
mod connected_components;
mod continuity;
mod crossings;
mod extent;
mod faces;
mod local_quadric;
mod mixed_pixels;
mod occlusion;
mod patch;
mod plate_selection;
mod range_noise;
mod refusal;
mod region_growing;
mod segmented_component;
mod smoothed_normals;
mod window;

use std::collections::BTreeMap;

use platen_scan::{Column, ColumnError, ScanHeader};

use crate::PlateSpec;
pub(crate) use background_planes::{DITHERED, PLANES as BACKGROUND_PLANES};
use column_store::{Cell, ColumnStore, Segment, StoredColumn, cells_of};
use completed_components::Completed;
use connected_components::{Components, Run};
use continuity::Continuity;
pub(crate) use mixed_pixels::detection_limit;
use occlusion::FacePiece;
pub use patch::{Beyond, Crossing, MixedPixels, Patch, PlaneBehind, PlaneSet, Sample};
pub use refusal::Refusal;
use segmented_component::SegmentedComponent;

/// A component that outgrows the plate's area by this factor is dropped.
const OUTGROWN: f64 = 4.0;

/// Least area across the beams, in parts of the plate's area, of a component that is evaluated: that of a strip of the
/// plate beside a chain, seen at a grazing angle.
const LEAST_PART: f64 = 0.005;

/// Length over which the region of interest may cut the plate's edge without refusal, metres.
const CUT_TOLERANCE: f64 = 0.05;

/// Extractor of the plate's scanned face from columns in any order.
///
/// The same columns give the same patch, to the last bit, whatever their order.
#[derive(Debug, Clone)]
pub struct Extractor {
    header: ScanHeader,
    spec: PlateSpec,
    continuity: Continuity,
    /// Sine and cosine of the nominal elevation of each row.
    elevation: Vec<(f64, f64)>,
    regions: Components,
    columns: ColumnStore,
    warm_up_columns: u32,
    /// Number of columns that have arrived in order and without a gap, counted from the first one and from the last
    /// one.
    in_order: [u32; 2],
    /// Components of about the plate's size that no later column can reach, by their roots.
    closed: BTreeMap<u32, Completed>,
}

impl Extractor {
    /// Prepares the extraction from a scan with this header.
    pub fn new(header: &ScanHeader, spec: &PlateSpec) -> Self {
        let elevation = |row: u32| header.elevation_start - header.elevation_step * f64::from(row);
        Self {
            header: header.clone(),
            spec: spec.clone(),
            continuity: Continuity::new(header),
            elevation: (0..header.n_rows).map(|row| elevation(row).sin_cos()).collect(),
            regions: Components::default(),
            columns: ColumnStore::default(),
            warm_up_columns: 0,
            in_order: [0; 2],
            closed: BTreeMap::new(),
        }
    }

    /// Adds a column. A column that was added before is ignored.
    ///
    /// # Errors
    /// As [`Column::check`]; the column is then not added.
    pub fn push(&mut self, column: &Column) -> Result<(), ColumnError> {
        column.check(self.header.n_rows)?;
        if self.columns.get(column.index).is_some() {
            return Ok(());
        }
        let azimuth = self.header.azimuth_start + self.header.azimuth_step * f64::from(column.index);
        let (sin_az, cos_az) = azimuth.sin_cos();
        let inside = |row: u32, range: f32| {
            self.spec.region.as_ref().is_none_or(|region| {
                let (sin_el, cos_el) = self.elevation[row as usize];
                let unit = [cos_el * cos_az, cos_el * sin_az, sin_el];
                (0..3).all(|k| (region.min[k]..=region.max[k]).contains(&(unit[k] * f64::from(range))))
            })
        };
        let cells = cells_of(column, &self.header, inside);
        let runs = self.add_runs(column.index, column.first_row, &cells);
        let segments = vec![Segment { first_row: column.first_row, cells }];
        self.columns.insert(column.index, StoredColumn { runs, segments });
        if let Some(before) = column.index.checked_sub(1) {
            self.join(before);
        }
        self.join(column.index);
        let limit_mm2 = self.plate_mm2(OUTGROWN);
        self.columns.sweep(&mut self.regions, self.header.n_columns, limit_mm2);
        self.look_at_closed(column.index);
        Ok(())
    }

    /// Excludes the first `columns` columns of each face of the scanner (laser warm-up).
    pub fn leave_out_warm_up(&mut self, columns: u32) {
        if self.warm_up_columns != columns {
            self.warm_up_columns = columns;
            self.closed.clear();
        }
    }

    /// Returns the number of cells held now, which determines the memory in use: cells of columns in which the plate
    /// may lie, and cells around the components that have been evaluated.
    #[must_use]
    pub fn cells_held(&self) -> usize {
        self.columns.n_cells() + self.closed.values().map(|c| c.surface.window.cells.len()).sum::<usize>()
    }

    /// Returns the plate's face, after all columns were added.
    ///
    /// # Errors
    /// [`Refusal`]: no plate, or more than one.
    pub fn finish(mut self) -> Result<Patch, Refusal> {
        self.check()?;
        let (near_size, larger) = self.components();
        let mut closed = std::mem::take(&mut self.closed);
        let mut known = BTreeMap::new();
        let mut surfaces = Vec::new();
        for root in near_size {
            surfaces.push(match closed.remove(&root) {
                Some(Completed { surface, plate }) => {
                    known.extend(plate.map(|(label, patch)| ((surface.root, label), patch)));
                    surface
                }
                None => self.surface(&[root]),
            });
        }
        let mut pieces = self.pieces(&surfaces, 0);
        let mut candidates = plate_selection::candidates(&pieces);
        if !candidates.iter().any(|c| c.fits(&self.spec)) {
            let more: Vec<SegmentedComponent> = larger.iter().map(|root| self.surface(&[*root])).collect();
            pieces.extend(self.pieces(&more, surfaces.len()));
            surfaces.extend(more);
            candidates = plate_selection::candidates(&pieces);
        }
        let step = (self.header.azimuth_step * self.header.elevation_step).sqrt();
        if candidates.is_empty() {
            // Components without a face: too few cells across, or no surface at all.
            surfaces
                .iter()
                .try_for_each(|surface| plate_selection::check_spacing(surface.spacing(), step))?;
        }
        let chosen = plate_selection::select(&candidates, &self.spec, step)?;
        let chosen: Vec<&FacePiece> = chosen.pieces.iter().map(|&i| &pieces[i]).collect();
        if let [piece] = chosen.as_slice()
            && let Some(patch) = known.remove(&(surfaces[piece.surface].root, piece.label))
        {
            return patch;
        }
        let joined;
        let surface = match self.roots(&surfaces, &chosen).as_slice() {
            [_] => &surfaces[chosen[0].surface],
            several => {
                joined = self.surface(several);
                &joined
            }
        };
        let region = |piece: &&FacePiece| surfaces[piece.surface].region(piece.label, &surface.window);
        self.patch(surface, &chosen.iter().map(region).collect::<Vec<_>>())
    }

    fn check(&self) -> Result<(), Refusal> {
        let ScanHeader { n_rows, azimuth_step, elevation_step, .. } = self.header;
        let is_step = |step: f64| step > 0.0 && step < 0.1;
        if n_rows == 0 || !is_step(azimuth_step) || !is_step(elevation_step) {
            return Err(Refusal::NotALattice { n_rows, azimuth_step, elevation_step });
        }
        let PlateSpec { width, height, .. } = self.spec;
        if !(width > 0.0 && height > 0.0) {
            return Err(Refusal::NoSize { width_mm: width * 1000.0, height_mm: height * 1000.0 });
        }
        Ok(())
    }

    fn plate_mm2(&self, factor: f64) -> u64 {
        (factor * self.spec.width * self.spec.height * 1e6) as u64
    }

    /// Splits the valid cells inside the region of interest into runs.
    fn add_runs(&mut self, column: u32, first_row: u32, cells: &[Cell]) -> std::ops::Range<u32> {
        let first = self.regions.n_runs();
        let cell_angle = self.header.azimuth_step * self.header.elevation_step;
        let usable = |cell: &Cell| cell.valid && cell.inside;
        let mut at = 0;
        while at < cells.len() {
            if !usable(&cells[at]) {
                at += 1;
                continue;
            }
            let start = at;
            let mut solid = 0.0;
            loop {
                let range = f64::from(cells[at].range_m);
                solid += range * range * self.elevation[first_row as usize + at].1;
                at += 1;
                let Some(next) = cells.get(at).filter(|cell| usable(cell)) else { break };
                let known = |i: usize| cells.get(i).filter(|cell| usable(cell)).map(|cell| cell.range_m);
                let beyond = || [if at >= 2 { known(at - 2) } else { None }, known(at + 1)];
                if !self.continuity.joins_down([cells[at - 1].range_m, next.range_m], beyond) {
                    break;
                }
            }
            let run = Run { column, first_row: first_row + start as u32, end_row: first_row + at as u32 };
            self.regions.add(run, (solid.abs() * cell_angle * 1e6) as u64);
        }
        first..self.regions.n_runs()
    }

    /// Joins the runs of column `left` with those of the next one, if both have arrived.
    fn join(&mut self, left: u32) {
        let (Some(a), Some(b)) = (self.columns.get(left), self.columns.get(left + 1)) else { return };
        self.regions.join_columns(
            a.runs.clone(),
            b.runs.clone(),
            &self.continuity.across,
            |row| a.range(row),
            |row| b.range(row),
        );
    }

    fn surface(&mut self, roots: &[u32]) -> SegmentedComponent {
        let mut window = window::Window::of(roots, &mut self.regions, &self.columns, &self.header);
        window.leave_out(self.warm_up_columns);
        SegmentedComponent::of(roots[0], window, &self.continuity)
    }

    /// Returns the faces of notable size of components that are numbered from `first` on.
    fn pieces(&self, surfaces: &[SegmentedComponent], first: usize) -> Vec<FacePiece> {
        let least = LEAST_PART * self.spec.width * self.spec.height;
        let numbered = surfaces.iter().zip(first..);
        numbered.flat_map(|(surface, number)| surface.pieces(number, least)).collect()
    }

    /// Returns the components that contain the chosen pieces.
    fn roots(&self, surfaces: &[SegmentedComponent], chosen: &[&FacePiece]) -> Vec<u32> {
        let mut roots = Vec::new();
        for piece in chosen {
            let root = surfaces[piece.surface].root;
            if !roots.contains(&root) {
                roots.push(root);
            }
        }
        roots
    }

    fn patch(&self, surface: &SegmentedComponent, regions: &[Vec<bool>]) -> Result<Patch, Refusal> {
        let SegmentedComponent { window, noise, pixels, background, slope_reach, normals, .. } = surface;
        let mut face = vec![false; window.cells.len()];
        for region in regions {
            for (cell, core) in face.iter_mut().zip(region_growing::erode(window, region, *slope_reach)) {
                *cell |= core;
            }
        }
        let face = region_growing::grow(window, noise, normals, face);
        let mut number = vec![0; face.len()];
        let mut samples = Vec::with_capacity(face.iter().filter(|f| **f).count());
        for (column, rows) in window.inner_spans(0) {
            for (cell, row) in (column * window.n_rows + rows.start..).zip(rows).filter(|(c, _)| face[*c]) {
                number[cell] = samples.len() as u32;
                samples.push(Sample {
                    point: window.points[cell].into(),
                    column: window.first_column + column as u32,
                    row: window.first_row + row as u32,
                    sigma: noise.of(column, row),
                    intensity: window.cells[cell].intensity,
                });
            }
        }
        let scene = crossings::Scene {
            window,
            noise,
            background_noise: &surface.background_noise,
            face: &face,
            pixels,
            background,
            flank_depth: self.spec.flank_depth(),
        };
        let (crossings, cut) = crossings::find(&scene, |cell| number[cell]);
        if cut > CUT_TOLERANCE {
            return Err(Refusal::CutByRegion { cut_mm: cut * 1000.0 });
        }
        Ok(Patch {
            samples,
            crossings,
            azimuth_step: self.header.azimuth_step,
            elevation_step: self.header.elevation_step,
            noise: f64::from(noise.pooled),
        })
    }
}
