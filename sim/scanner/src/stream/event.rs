//! What happens to a connection: told by its reader, and by the scans that it listens to.

use super::frame::Frame;

/// What a connection waits for.
#[derive(Debug)]
pub(super) enum Event {
    /// The driver says this.
    Frame(Frame),
    /// The driver has gone, or what it says is no frame.
    Closed,
    /// A scan has grown or ended.
    ScanAdvanced,
}
