//! Plugin boundary: the header against the Rust types, a scanner in C, every way in which a library can be invalid, and
//! the cost of each.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod boundary;
mod check;
mod misbehaviour;
mod new_plugin;
mod schemas;
mod surface_header;
