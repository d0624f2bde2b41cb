//! Accuracy of `platen measure` and `platen bench` against known truth.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod bench;
mod bevel;
mod blank;
mod golden;
mod null_pairs;
mod plates;
mod trim;
mod trust;
