//! Early evaluation of components that no later column can join, and selection of candidate components by size.
//!
//! A component of about the plate's size is evaluated as soon as it has ended, while columns still arrive, so that most
//! of the work is done before the last column. Limit: columns arrive in order, ascending or descending.

use std::collections::BTreeSet;

use super::column_store::MARGIN;
use super::connected_components::Extent;
use super::extent::WidthBound;
use super::segmented_component::SegmentedComponent;
use super::{Extractor, LEAST_PART, OUTGROWN, Refusal, plate_selection};
use crate::Patch;

/// Largest area and width, in parts of the plate's area and diagonal, of a component that contains little besides the
/// plate. Larger components are evaluated only when no plate is found among these.
const NEAR_SIZE: (f64, f64) = (1.15, 1.15);

/// Least area, in parts of the plate's area, of a component that is evaluated as soon as it has ended. Smaller ones are
/// evaluated after the last column: otherwise every piece of furniture in a full-dome scan would hold memory until
/// then.
const CLOSED_PART: f64 = 0.3;

/// A component evaluated before the last column has arrived.
#[derive(Debug, Clone)]
pub(super) struct Completed {
    pub(super) surface: SegmentedComponent,
    /// Label and result of the face that alone has the plate's size.
    pub(super) plate: Option<(u32, Result<Patch, Refusal>)>,
}

impl Extractor {
    /// Evaluates the components that ended so many columns before `newest` that no later column joins them, as long as
    /// columns arrive in order, ascending or descending.
    pub(super) fn look_at_closed(&mut self, newest: u32) {
        let first = self.header.n_columns.saturating_sub(1);
        let before = [Some(newest), first.checked_sub(newest)];
        let Some(sense) = [0, 1].into_iter().find(|&sense| before[sense] == Some(self.in_order[sense]))
        else {
            return;
        };
        if self.check().is_err() {
            return;
        }
        self.in_order[sense] += 1;
        let ended =
            [newest.checked_sub(MARGIN + 1), newest.checked_add(MARGIN + 1).filter(|last| *last <= first)];
        let Some(last) = ended[sense] else { return };
        let runs = self.columns.get(last).map_or(0..0, |column| column.runs.clone());
        let roots: BTreeSet<u32> = runs.map(|number| self.regions.root(number)).collect();
        for root in roots {
            let extent = self.regions.extent(root);
            let end = [extent.columns.1, extent.columns.0][sense];
            let large = extent.area_mm2 >= self.plate_mm2(CLOSED_PART);
            if end == last && large && self.is_near_size(root) {
                let surface = self.surface(&[root]);
                let plate = self.plate_of(&surface);
                self.closed.insert(root, Completed { surface, plate });
            }
        }
    }

    /// Returns the face of a component that alone has the plate's size, evaluated as if it were the selected one.
    fn plate_of(&self, surface: &SegmentedComponent) -> Option<(u32, Result<Patch, Refusal>)> {
        let pieces = self.pieces(std::slice::from_ref(surface), 0);
        let candidates = plate_selection::candidates(&pieces);
        let fitting = candidates.iter().find(|c| c.pieces.len() == 1 && c.fits(&self.spec))?;
        let label = pieces[fitting.pieces[0]].label;
        Some((label, self.patch(surface, &[surface.region(label, &surface.window)])))
    }

    /// Returns true when a component may contain a piece of the plate.
    fn may_be_plate(&self, extent: Extent) -> bool {
        (self.plate_mm2(LEAST_PART)..=self.plate_mm2(OUTGROWN)).contains(&extent.area_mm2)
    }

    /// Returns true when a component contains little besides the plate.
    fn is_near_size(&mut self, root: u32) -> bool {
        let extent = self.regions.extent(root);
        if extent.area_mm2 > self.plate_mm2(NEAR_SIZE.0) {
            return false;
        }
        let mut spread = WidthBound::default();
        for index in extent.columns.0..=extent.columns.1 {
            let Some(column) = self.columns.get(index) else { continue };
            let azimuth = self.header.azimuth_start + self.header.azimuth_step * f64::from(index);
            let (sin_az, cos_az) = azimuth.sin_cos();
            for run in self.regions.runs_of(&[root], column.runs.clone()) {
                for row in [run.first_row, run.end_row - 1] {
                    let (sin_el, cos_el) = self.elevation[row as usize];
                    let range = f64::from(column.range(row));
                    spread.add([cos_el * cos_az, cos_el * sin_az, sin_el].map(|c| c * range));
                }
            }
        }
        spread.width() <= NEAR_SIZE.1 * self.spec.width.hypot(self.spec.height)
    }

    /// Returns the components that may contain a piece of the plate, in the order of their first cells: those of about
    /// its size or smaller, then larger ones.
    pub(super) fn components(&mut self) -> (Vec<u32>, Vec<u32>) {
        let mut roots = Vec::new();
        for index in 0..self.columns.len() {
            let runs = self.columns.get(index).map_or(0..0, |column| column.runs.clone());
            for number in runs {
                let root = self.regions.root(number);
                if self.may_be_plate(self.regions.extent(root)) && !roots.contains(&root) {
                    roots.push(root);
                }
            }
        }
        roots.into_iter().partition(|root| self.closed.contains_key(root) || self.is_near_size(*root))
    }
}
