//! Multi-threaded scan, delivered column by column in order.

use crate::column::SimColumn;
use crate::instrument::Instrument;
use crate::lattice::SimLattice;
use crate::measure::{Trace, View};
use crate::scene::Scene;
use std::ops::{ControlFlow, Range};

/// Columns per batch: enough to keep all threads busy, few enough to deliver steadily.
const BATCH: u32 = 64;

/// Scans a scene and passes every column, in order, to `deliver` until it returns `Break`.
///
/// The result does not depend on `threads`: random numbers are assigned per column.
pub fn scan(
    scene: &Scene,
    lattice: &SimLattice,
    instrument: &Instrument,
    threads: usize,
    deliver: impl FnMut(SimColumn) -> ControlFlow<()>,
) -> ControlFlow<()> {
    scan_range(scene, lattice, instrument, threads, 0..lattice.n_columns, deliver)
}

/// Scans a range of columns; they are equal to those of the whole scan.
pub(crate) fn scan_range(
    scene: &Scene,
    lattice: &SimLattice,
    instrument: &Instrument,
    threads: usize,
    columns: Range<u32>,
    mut deliver: impl FnMut(SimColumn) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let view = View { scene, lattice, instrument };
    let mut traces: Vec<Trace> = Vec::new();
    // Column of traces[0].
    let mut first = columns.start.saturating_sub(1);
    for start in columns.clone().step_by(BATCH as usize) {
        let end = (start + BATCH).min(columns.end);
        // One column more than is measured: the neighbour of the last.
        let traced = first + traces.len() as u32;
        traces
            .extend(parallel(traced..(end + 1).min(lattice.n_columns), threads, |column| view.trace(column)));
        let measured = parallel(start..end, threads, |column| {
            let here = (column - first) as usize;
            let before = here.checked_sub(1).map(|before| &traces[before]);
            view.measure(column, before, &traces[here], traces.get(here + 1))
        });
        for column in measured {
            deliver(column)?;
        }
        let done = (end - first) as usize - 1;
        traces.drain(..done);
        first += done as u32;
    }
    ControlFlow::Continue(())
}

/// Scans a scene and returns all columns.
pub fn scan_all(
    scene: &Scene,
    lattice: &SimLattice,
    instrument: &Instrument,
    threads: usize,
) -> Vec<SimColumn> {
    let mut columns = Vec::with_capacity(lattice.n_columns as usize);
    let _ = scan(scene, lattice, instrument, threads, |column| {
        columns.push(column);
        ControlFlow::Continue(())
    });
    columns
}

/// Runs `work` for every column of a range and returns the results in order; neighbouring columns run on different
/// threads.
fn parallel<T: Send>(columns: Range<u32>, threads: usize, work: impl Fn(u32) -> T + Sync) -> Vec<T> {
    let threads = threads.clamp(1, columns.len().max(1));
    if threads == 1 {
        return columns.map(work).collect();
    }
    let share = |thread: usize| columns.clone().skip(thread).step_by(threads).map(&work).collect::<Vec<T>>();
    std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|thread| scope.spawn(move || share(thread))).collect();
        let mut shares = vec![share(0).into_iter()];
        for other in others {
            match other.join() {
                Ok(done) => shares.push(done.into_iter()),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        (0..columns.len()).filter_map(|k| shares[k % threads].next()).collect()
    })
}
