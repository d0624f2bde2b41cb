//! Long test set, run by name: accuracy over many simulated scans, and memory up to a full dome.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod advice;
mod isolation;
mod random;
mod samples;
mod scale;
mod simulated;
