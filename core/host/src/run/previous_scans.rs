//! Previous scans of the active plate, from the history and the result folders.

use platen_history::{Archive, Error, Stroke};
use platen_report::{history_view, output_folder};
use platen_shape::{Blank, Surface};

#[derive(Debug)]
pub(crate) struct Earlier {
    pub(crate) surface: Surface,
    /// Outline to which its (u, v) refer, if a scan of the blank gave one.
    pub(crate) blank: Option<Blank>,
    pub(crate) supports: Option<String>,
    /// Feed rotation as reported by the press, radians.
    pub(crate) plate_rot: Option<f64>,
}

/// Stroke before a run, and scan of the blank.
#[derive(Debug, Default)]
pub(crate) struct PreviousScans {
    pub(crate) before: Option<Earlier>,
    pub(crate) baseline: Option<Earlier>,
}

impl PreviousScans {
    /// Reads the recorded scans whose files exist; the log lists the others.
    pub(crate) fn of(archive: &Archive, run_id: u32) -> Self {
        Self { before: load(archive.before(run_id)), baseline: load(archive.baseline(run_id)) }
    }

    /// Returns the last scan of the plate: the stroke before, else the baseline.
    pub(crate) fn last(&self) -> Option<&Earlier> {
        self.before.as_ref().or(self.baseline.as_ref())
    }
}

fn load(found: Result<Option<Stroke>, Error>) -> Option<Earlier> {
    let stroke = found
        .inspect_err(|error| tracing::warn!("{error}; this stroke is compared with none"))
        .ok()
        .flatten()?;
    let data = stroke.press_data();
    let document = stroke.document?;
    let surface = output_folder::surface_beside(&document)
        .inspect_err(|why| tracing::warn!("{why}; this stroke is compared without it"))
        .ok()?;
    let earlier = history_view::read_document(&document);
    Some(Earlier { surface, blank: earlier.blank(), supports: earlier.supports, plate_rot: data.plate_rot })
}
