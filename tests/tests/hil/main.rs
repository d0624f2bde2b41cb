//! Hardware in the loop with simulated hardware: the product's press side, its host and its scanner driver on real
//! sockets and lines, most as processes of their own.
#![allow(clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod cell;
mod rig;
mod stream;

mod advice;
mod archive;
mod bridge_check;
mod clock;
mod isolation;
mod kill;
mod line;
mod peer_run;
mod peers;
mod plants;
mod press;
mod run;
mod scanner_cell;
mod scanner_light;
mod scanner_link;
mod scanner_record;
mod screen;
mod service;
mod verbs;
