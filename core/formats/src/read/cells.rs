//! Batches of cells in the order of the file: of a packet, or of a fixed number. One dynamic call a batch instead of one a cell; for speed only: `tests::speed`.

use crate::orient::RawCell;

use super::error::Result;

/// Cells of a batch where the format has no packets.
const BATCH: usize = 1 << 12;

/// Cells in the order of the file. Nothing follows an error.
pub(crate) trait Cells: Send {
    /// Appends the next cells; none behind the last.
    ///
    /// # Errors
    /// That of the file, behind the cells before it.
    fn append(&mut self, batch: &mut Vec<RawCell>) -> Result<()>;
}

impl<I: Iterator<Item = Result<RawCell>> + Send> Cells for I {
    fn append(&mut self, batch: &mut Vec<RawCell>) -> Result<()> {
        self.take(BATCH).try_for_each(|cell| {
            batch.push(cell?);
            Ok(())
        })
    }
}

/// Returns the cells one by one.
pub(super) fn each<'a>(mut cells: Box<dyn Cells + 'a>) -> impl Iterator<Item = Result<RawCell>> + use<'a> {
    let (mut batch, mut next, mut error) = (Vec::new(), 0, None);
    std::iter::from_fn(move || {
        if next == batch.len() && error.is_none() {
            batch.clear();
            next = 0;
            error = cells.append(&mut batch).err();
        }
        let cell = batch.get(next).copied();
        next += usize::from(cell.is_some());
        cell.map(Ok).or_else(|| error.take().map(Err))
    })
}
