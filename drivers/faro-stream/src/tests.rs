//! The session against a bridge written from the page, in memory; the socket once.

mod bridge;
mod faults;
mod lattice;
mod link;
