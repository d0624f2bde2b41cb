//! Events into the handshake, effects out of it, and commands to the measurement.

use std::time::Duration;

use super::Transition;
use crate::{Code, Measurement, PressImage, Record, Stage, StrokeData, StrokeKey};

/// Observation of the handshake.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A connection is open.
    Connected,
    /// The connection is lost.
    Disconnected,
    /// The press block was read; on a serial line between strokes only its fast part.
    Press(Box<PressImage>),
    /// The host block was read back.
    Host {
        /// Installation number there; `None` where the map has no such field.
        owner: Option<u16>,
        /// The heartbeat there; `None` where the map has no such field.
        heartbeat: Option<u16>,
        /// Whether both may have been written by this host.
        mine: bool,
    },
    /// Every word of the wanted registers was echoed by the press.
    Written,
    /// A record was written by the journal, or could not be.
    Journaled {
        /// The stroke.
        key: StrokeKey,
        /// Stage of the record.
        stage: Stage,
        /// Whether the record survives a power cut.
        ok: bool,
    },
    /// Readiness of the scanner.
    Scanner {
        /// Reason why no scan is possible.
        ready: Result<(), Code>,
        /// Estimated duration of one scan.
        estimate: Option<Duration>,
    },
    /// The scan of a stroke is complete.
    Acquired(StrokeKey),
    /// The result of a stroke.
    Measured(StrokeKey, Box<Measurement>),
    /// Scan or evaluation of a stroke failed.
    Failed(StrokeKey, Code),
    /// An exception of the controller or a refused write: a fault until reset.
    Fault(Code),
    /// The operator resets faults.
    Reset,
    /// The host ends.
    Stop,
    /// Time has passed.
    Tick,
}

/// Command of the handshake to the measurement, passed on unchanged by every part in between.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// Scan a stroke; answered with [`Answer::Acquired`](crate::Answer::Acquired) or
    /// [`Answer::Failed`](crate::Answer::Failed).
    Scan {
        /// The stroke.
        key: StrokeKey,
        /// Key of its record.
        run_id: u32,
        /// Data of the press about it.
        data: Box<StrokeData>,
    },
    /// Evaluate the scan of a stroke; answered with [`Answer::Result`](crate::Answer::Result) or
    /// [`Answer::Failed`](crate::Answer::Failed). Follows the acquisition, and a restart between the two.
    Evaluate(StrokeKey),
    /// Abandon scan and evaluation of a stroke; later answers about it are ignored.
    Cancel(StrokeKey),
    /// Close the record of the plate: it is finished and leaves the press.
    PartEnd,
}

/// Action of the caller, to be carried out in the order of the list.
#[derive(Debug, Clone, PartialEq)]
pub enum Effect {
    /// Write a record; answered with [`Event::Journaled`].
    Journal(Record),
    /// Pass a command on to the measurement.
    Command(Command),
    /// Drop the connection and connect again after a pause.
    Reconnect,
    /// Raise an alarm, once per cause.
    Alarm(Code),
    /// Log a transition that was taken.
    Transition(Transition),
}
