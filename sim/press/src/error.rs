//! Errors of a simulated press.

use std::net::SocketAddr;
use std::time::Duration;

use platen_sim_plate::PlateError;

/// Error of a press, by the person who must act.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Invalid configuration: change it.
    #[error("simulated press: {key}: {why}")]
    Config {
        /// Key in the configuration.
        key: &'static str,
        /// Reason and permitted values.
        why: String,
    },
    /// Plate that cannot be built or bent: change the blank, the target or the plan.
    #[error("simulated press: {0}")]
    Plate(#[from] PlateError),
    /// Port unavailable: free it or write 0.
    #[error(
        "simulated press: cannot listen on {address}: {source}; free the port, or write 0 to let the system choose"
    )]
    Listen {
        /// Requested address.
        address: SocketAddr,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Serial line that cannot be opened.
    #[error(
        "simulated press: cannot open {device}: {source}; check the name, and that no other program has opened it"
    )]
    Serial {
        /// Name of the device.
        device: String,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// Command not permitted in the present state.
    #[error("simulated press: command refused: {0}")]
    Refused(&'static str),
    /// Awaited state not reached in time.
    #[error("simulated press: {what}: not reached within {limit:?}; counters {counters}")]
    Late {
        /// Awaited state.
        what: String,
        /// Time limit.
        limit: Duration,
        /// Counters as JSON.
        counters: String,
    },
}
