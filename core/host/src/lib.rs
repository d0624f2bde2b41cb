//! Library of the program `platen`: the command line, and `run`, which serves a press.

pub mod cli;
mod judgement;
mod plate_history;
mod plugin_records;
pub mod progress;
pub mod run;
mod sha256;
