//! A bridge: the server beside a scanner that speaks the scan bridge protocol, for hosts to be tested on.
//!
//! Written from the protocol's page alone, so that a mistake of the driver and one of the page do not cancel. A
//! [`Bridge`] serves scans of a [`Head`]: of a [`RayCastHead`], where rays are cast at a simulated plate, or of a
//! [`Recording`] of earlier frames. Scans lie on disk while they are measured and sent, so that their size costs no
//! memory; a driver that is slow, or comes back after its connection broke, gets every column all the same.
//!
//! A scan takes the time of a real scanner, scaled. [`FaultKind`] lists what can go wrong; what goes wrong with the
//! light (noise, bias, warm-up, two faces) is in [`crate::Instrument`].

mod bridge;
mod config;
mod connection;
mod counters;
mod event;
mod fault;
mod frame;
mod frame_faults;
mod head;
mod message;
mod payload;
mod ray_cast_head;
mod shared;
mod spool;

pub use bridge::Bridge;
pub use config::BridgeConfig;
pub use counters::BridgeCounters;
pub use fault::{Fault, FaultKind};
pub use head::{Head, Plan, Receiver, Recording};
pub use message::{ScanLayout, ScanSettings, Values, Window};
pub use payload::column_payload;
pub use ray_cast_head::{PlateSource, RayCastHead};
