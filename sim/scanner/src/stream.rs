//! Scan bridge: the server of the scan bridge protocol beside a scanner, for tests of hosts and drivers.
//!
//! It is written from the protocol document alone, so that an error of the driver and one of the document do not
//! cancel. A [`Bridge`] serves the scans of a [`Head`]: a [`RayCastHead`], which casts rays at a simulated plate, or a
//! [`Recording`] of earlier frames. Scans are spooled to disk while they are measured and sent. Their size therefore
//! needs no memory, and a driver that is slow or reconnects receives every column.
//!
//! A scan takes the time of a real scanner, scaled by a factor. [`FaultKind`] lists the faults of link, bridge and
//! scanner; errors of the measurement (noise, bias, warm-up, two faces) belong to [`crate::Instrument`].

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
