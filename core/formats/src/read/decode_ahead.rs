//! Decoding on a separate thread: the next cells are decoded while the previous ones are used.
//!
//! For speed only: `tests::speed`.

use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread;

use super::cells::Cells;
use super::error::{ReadError, Result};
use crate::orient::{Converted, ToSpherical};

/// Largest number of decoded batches that wait.
const AHEAD: usize = 4;

/// Calls `take` with all cells, some at a time, in the order of the file; an error from it ends the pass.
///
/// # Errors
/// The error of `take`, or that of the file, after the cells before it.
pub(super) fn for_each<E: From<ReadError>>(
    cells: Box<dyn Cells + '_>,
    mut take: impl FnMut(&Converted) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    let (filled, batches) = sync_channel(AHEAD);
    let (used, spare) = channel();
    thread::scope(|scope| {
        let decoder = thread::Builder::new().name("decode".to_owned());
        let started = decoder.spawn_scoped(scope, move || decode(cells, &filled, &spare));
        started.map_err(ReadError::io("starting a thread"))?;
        for batch in batches {
            let batch: Converted = batch?;
            take(&batch)?;
            // The decoder may have ended.
            let _ = used.send(batch);
        }
        Ok(())
    })
}

/// Sends the cells in batches until the end, an error, or the end of the receiver.
fn decode(
    mut cells: Box<dyn Cells + '_>,
    filled: &SyncSender<Result<Converted>>,
    spare: &Receiver<Converted>,
) {
    let mut to_spherical = ToSpherical::default();
    loop {
        let mut batch = spare.try_recv().unwrap_or_default();
        batch.clear();
        let end = cells.append(&mut to_spherical, &mut batch);
        let is_last = batch.parts.is_empty();
        let sent = filled.send(Ok(batch));
        if let Err(error) = end {
            // The receiver may have ended.
            let _ = filled.send(Err(error));
            return;
        }
        if sent.is_err() || is_last {
            return;
        }
    }
}
