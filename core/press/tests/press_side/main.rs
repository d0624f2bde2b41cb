//! Press side of the product against a simulated PLC, faulty peers and random events.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod simulated_plc;

mod bad_peers;
mod handshake;
mod readme;
mod rtu;
mod server_role;
mod tcp;
mod virtual_time;
