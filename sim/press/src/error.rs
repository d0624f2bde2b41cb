//! What can go wrong with a simulated press.

use std::net::SocketAddr;
use std::time::Duration;

use platen_sim_plate::PlateError;

/// Why a press cannot start, execute or go on.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The configuration contradicts itself: change it.
    #[error("simulated press: {key}: {why}")]
    Config {
        /// Key of the table.
        key: &'static str,
        /// What is wrong and what is possible.
        why: String,
    },
    /// The plate cannot be bent so: change the blank, the target or the plan.
    #[error("simulated press: {0}")]
    Plate(#[from] PlateError),
    /// A port cannot be had: free it or write 0.
    #[error(
        "simulated press: cannot listen on {address}: {source}; free the port or let the system choose with 0"
    )]
    Listen {
        /// Address that was asked for.
        address: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// A serial line cannot be opened.
    #[error("simulated press: cannot open {device}: {source}; check the name and who else has it open")]
    Serial {
        /// Name of the device.
        device: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// A command that does not fit the state of the press.
    #[error("simulated press: refused: {0}")]
    Refused(&'static str),
    /// A state that was waited for did not come.
    #[error("simulated press: not within {limit:?}: {what}; the press saw {counters}")]
    Late {
        /// What was waited for.
        what: String,
        /// How long.
        limit: Duration,
        /// The counters as JSON.
        counters: String,
    },
}
