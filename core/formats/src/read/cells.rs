//! Batches of cells in the order of the file: those of a packet, or a fixed number.
//!
//! There is one dynamic call per batch instead of one per cell; for speed only: `tests::speed`.

use crate::orient::{Converted, RawCell, ToSpherical};

use super::error::Result;

/// Number of cells of a batch where the format has no packets.
const BATCH: usize = 1 << 12;

/// Cells in the order of the file. No cell follows an error.
pub(crate) trait Cells: Send {
    /// Appends the next cells; none after the last.
    ///
    /// # Errors
    /// The error of the file, after the cells before it.
    fn append(&mut self, to_spherical: &mut ToSpherical, batch: &mut Converted) -> Result<()>;
}

impl<I: Iterator<Item = Result<RawCell>> + Send> Cells for I {
    fn append(&mut self, to_spherical: &mut ToSpherical, batch: &mut Converted) -> Result<()> {
        self.take(BATCH).try_for_each(|cell| {
            to_spherical.append(&cell?, batch);
            Ok(())
        })
    }
}

/// Returns the cells batch by batch.
pub(super) fn batches<'a>(
    mut cells: Box<dyn Cells + 'a>,
) -> impl Iterator<Item = Result<Converted>> + use<'a> {
    let (mut to_spherical, mut error) = (ToSpherical::default(), None);
    std::iter::from_fn(move || {
        if let Some(error) = error.take() {
            return Some(Err(error));
        }
        let mut batch = Converted::default();
        error = cells.append(&mut to_spherical, &mut batch).err();
        if batch.parts.is_empty() { error.take().map(Err) } else { Some(Ok(batch)) }
    })
}
