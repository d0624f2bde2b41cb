//! The program `platen`: command line, and `run`, which serves a press.

pub mod cli;
pub mod progress;
pub mod run;
