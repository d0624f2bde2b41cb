//! Decoding on a thread of its own: the next cells are decoded while those before are used. For speed only: `tests::speed`.

use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread;

use super::error::{ReadError, Result};
use super::{Cells, SphericalCell, ToSpherical};

/// Cells handed over at once.
const BATCH: usize = 1 << 12;

/// Batches that wait.
const AHEAD: usize = 4;

/// A cell, and the parts of its direction's unit vector to the east, to the north and horizontal.
type Converted = (SphericalCell, [f64; 3]);

/// Calls `take` with every cell, in the order of the file; an error from it ends the pass.
///
/// # Errors
/// The error of `take`, or that of the file, after the cells before it.
pub(super) fn for_each<E: From<ReadError>>(
    cells: Cells<'_>,
    mut take: impl FnMut(&Converted) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    let (filled, batches) = sync_channel(AHEAD);
    let (used, spare) = channel();
    thread::scope(|scope| {
        let decoder = thread::Builder::new().name("decode".to_owned());
        let started = decoder.spawn_scoped(scope, move || decode(cells, &filled, &spare));
        started.map_err(ReadError::io("starting a thread"))?;
        for batch in batches {
            let batch: Vec<Converted> = batch?;
            batch.iter().try_for_each(&mut take)?;
            // The decoder may have ended.
            let _ = used.send(batch);
        }
        Ok(())
    })
}

/// Sends the cells in batches until the end or an error, or until nobody takes them.
fn decode(cells: Cells<'_>, filled: &SyncSender<Result<Vec<Converted>>>, spare: &Receiver<Vec<Converted>>) {
    let mut to_spherical = ToSpherical::default();
    let mut batch = Vec::with_capacity(BATCH);
    for cell in cells {
        match cell {
            Ok(cell) => batch.push(to_spherical.convert(&cell)),
            Err(error) => {
                // Nobody may be left to take either.
                let _ = filled.send(Ok(batch)).and_then(|()| filled.send(Err(error)));
                return;
            }
        }
        if batch.len() == BATCH {
            let mut next = spare.try_recv().unwrap_or_else(|_| Vec::with_capacity(BATCH));
            next.clear();
            if filled.send(Ok(std::mem::replace(&mut batch, next))).is_err() {
                return;
            }
        }
    }
    let _ = filled.send(Ok(batch));
}
