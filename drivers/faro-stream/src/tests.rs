//! Tests of the session against a bridge in memory, written from the protocol document, and tests of the socket.

mod bridge;
mod faults;
mod lattice;
mod link;
