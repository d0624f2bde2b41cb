//! The host: loads plugins, measures plates, runs strokes, answers on the command line.

pub mod cli;
pub mod plugin;
