//! Tests of the session against a bridge in memory, written from the protocol's page, and of the socket.

mod bridge;
mod faults;
mod lattice;
mod link;
