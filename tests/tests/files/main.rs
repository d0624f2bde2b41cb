//! Files from users: every format, damaged scans, faulty plants.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod check;
mod formats;
mod records;
mod refusals;
