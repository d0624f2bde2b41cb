//! Writer of the advice registers at the press, independent of the handshake.
//!
//! A refused write is logged and not repeated, and measuring continues.

use platen_plant::press::{AdviceBlock, Mode, Press};

use crate::codec::STATE;
use crate::{AdviceImage, Client, Link, LinkError, StrokeKey};

/// Desired and known content of the advice registers of one press; without `[advice] show = "screen_and_registers"` it
/// does nothing.
#[derive(Debug)]
pub(crate) struct AdviceWriter {
    block: Option<AdviceBlock>,
    wanted: AdviceImage,
    /// Content of the registers; `None` after a new connection, when their content is unknown.
    known: Option<AdviceImage>,
    /// Last published stroke, until the next trigger.
    published: Option<StrokeKey>,
    /// Advice that waits until its stroke has been published.
    offered: Option<(StrokeKey, AdviceImage)>,
    seq: u16,
    pretend: bool,
    refused: bool,
}

impl AdviceWriter {
    pub(crate) fn new(press: &Press) -> Self {
        Self {
            block: press.advice,
            wanted: AdviceImage::NONE,
            known: None,
            published: None,
            offered: None,
            seq: 0,
            pretend: press.mode == Mode::DryRun,
            refused: false,
        }
    }

    /// Accepts the advice after a stroke. Advice that arrives after the next trigger is dropped.
    pub(crate) fn offer(&mut self, stroke: StrokeKey, advice: AdviceImage) {
        self.offered = Some((stroke, advice));
        self.set();
    }

    /// Records that the result of a stroke is valid in the registers.
    pub(crate) fn publish(&mut self, stroke: StrokeKey) {
        self.published = Some(stroke);
        self.set();
    }

    /// Sets the advice after the published stroke.
    fn set(&mut self) {
        if let Some((_, advice)) = self.offered.take_if(|(stroke, _)| self.published == Some(*stroke)) {
            // 0 is the sequence number of registers without advice.
            self.seq = self.seq.checked_add(1).unwrap_or(1);
            self.wanted = advice;
            self.wanted.0[0] = self.seq;
        }
    }

    /// Withdraws the advice: the next stroke has been made, or the advice may no longer be valid.
    pub(crate) fn withdraw(&mut self) {
        self.published = None;
        self.wanted = AdviceImage::NONE;
        self.wanted.0[0] = self.seq;
    }

    /// Marks the content of the registers as unknown after a new connection.
    pub(crate) fn forget(&mut self) {
        self.known = None;
        self.refused = false;
    }

    /// Writes the differences. For advice that is withdrawn only the state is written; for new advice everything, and
    /// its sequence number last.
    ///
    /// # Errors
    /// An error that ended the connection.
    pub(crate) async fn write<L: Link>(&mut self, client: &mut Client<L>) -> Result<(), LinkError> {
        let Some(block) = self.block.filter(|_| !self.refused && self.known != Some(self.wanted)) else {
            return Ok(());
        };
        let words = self.wanted.0;
        let steps = if words[STATE] == 0 { [STATE..STATE + 1, 0..0] } else { [1..words.len(), 0..1] };
        for range in steps.into_iter().filter(|range| !range.is_empty()) {
            if self.pretend {
                tracing::info!(start = block.start, words = ?&words[range], "dry run: would write advice");
                continue;
            }
            match client.guarded_write(block.start + range.start as u16, &words[range]).await {
                Err(error @ (LinkError::Exception { .. } | LinkError::Refused { .. })) => {
                    tracing::warn!(%error, "the advice is not in the registers; nothing is written there until the next connection");
                    self.refused = true;
                    return Ok(());
                }
                other => other?,
            }
        }
        self.known = Some(self.wanted);
        Ok(())
    }
}
