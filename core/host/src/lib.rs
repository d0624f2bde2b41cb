//! The host: loads plugins, measures plates, runs strokes, answers on the command line.

pub mod accuracy;
pub mod calibration;
pub mod cli;
pub mod files;
pub mod past;
pub mod picture;
pub mod plugin;
pub mod progress;
pub mod record;
pub mod report;
pub mod rig;
pub mod run;
pub mod scan_file;
pub mod sequence;
pub mod stroke;
pub mod table;
