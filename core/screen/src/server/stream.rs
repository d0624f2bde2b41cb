//! Event stream of a page: complete states when they change, and beats with the age of the press cycle.
//!
//! A slow reader misses states but never receives an outdated one.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::response::sse::{Event, Sse};
use futures_util::Stream;
use futures_util::stream::unfold;
use tokio::sync::watch;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval, sleep_until};

use crate::page::LivePage;
use crate::source::present;
use crate::{Beat, Snapshot, Source, View};

/// Period of beats.
const BEAT: Duration = Duration::from_millis(500);
/// Shortest time between two states.
const APART: Duration = Duration::from_millis(100);
/// Beats from one update of the engineer's page to the next.
const RENEWAL: u64 = 2;

/// Content of the states of a stream.
#[derive(Debug, Clone, Copy)]
pub(super) enum Feed {
    /// Snapshots, for other programs.
    Snapshots,
    /// Cells of a page.
    Page(LivePage, View),
}

struct Reader {
    source: Arc<dyn Source>,
    feed: Feed,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    beat: Interval,
    beats: u64,
    next_state: Instant,
}

/// Returns the events of a feed; the first is the present state.
pub(super) fn events(
    source: Arc<dyn Source>,
    feed: Feed,
) -> Sse<impl Stream<Item = Result<Event, Infallible>>> {
    let mut snapshots = source.snapshots();
    snapshots.mark_changed();
    let mut beat = interval(BEAT);
    beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let reader = Reader { source, feed, snapshots, beat, beats: 0, next_state: Instant::now() };
    Sse::new(unfold(reader, async |mut reader| {
        let event = reader.next().await?;
        Some((Ok(event), reader))
    }))
}

impl Reader {
    /// Returns the next event; `None` when the host has ended.
    async fn next(&mut self) -> Option<Event> {
        let due = async {
            let changed = self.snapshots.changed().await;
            // A beat may be sent first: the change stays marked.
            self.snapshots.mark_changed();
            sleep_until(self.next_state).await;
            changed
        };
        tokio::select! {
            biased;
            changed = due => {
                changed.ok()?;
                self.state()
            }
            _ = self.beat.tick() => {
                self.beats += 1;
                if matches!(self.feed, Feed::Page(LivePage::Engineer, _)) && self.beats.is_multiple_of(RENEWAL) {
                    self.snapshots.mark_changed();
                }
                self.beat_event()
            }
        }
    }

    fn state(&mut self) -> Option<Event> {
        self.next_state = Instant::now() + APART;
        self.snapshots.mark_unchanged();
        let event = Event::default().event("state");
        match self.feed {
            Feed::Snapshots => event.json_data(&*present(&*self.source)),
            Feed::Page(page, view) => event.json_data(page.cells(&*self.source, view)),
        }
        .ok()
    }

    fn beat_event(&self) -> Option<Event> {
        let (boot, seq) = {
            let snapshot = self.snapshots.borrow();
            (snapshot.boot.clone(), snapshot.seq)
        };
        let cycle_age_ms = u64::try_from(self.source.cycle_age().as_millis()).unwrap_or(u64::MAX);
        Event::default().event("beat").json_data(Beat { boot, seq, cycle_age_ms }).ok()
    }
}
