//! Batches of cells in the order of the file: of a packet, or of a fixed number. One dynamic call a batch instead of one a cell; for speed only: `tests::speed`.

use crate::orient::{Converted, RawCell, ToSpherical};

use super::error::Result;

/// Cells of a batch where the format has no packets.
const BATCH: usize = 1 << 12;

/// Cells in the order of the file. Nothing follows an error.
pub(crate) trait Cells: Send {
    /// Appends the next cells; none behind the last.
    ///
    /// # Errors
    /// That of the file, behind the cells before it.
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
