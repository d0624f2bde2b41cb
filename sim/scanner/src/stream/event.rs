//! Events of a connection, from its reader and from the scan being sent.

use super::frame::Frame;

/// Event of a connection.
#[derive(Debug)]
pub(super) enum Event {
    /// Frame received from the driver.
    Frame(Frame),
    /// Connection closed, or invalid frame received.
    Closed,
    /// New columns, or the end of the scan.
    ScanAdvanced,
}
