//! The plugin boundary: header against Rust types, a scanner in C, every way in which a library can be wrong, and what each costs.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod boundary;
mod check;
mod misbehaviour;
mod new_plugin;
mod schemas;
mod surface_header;
