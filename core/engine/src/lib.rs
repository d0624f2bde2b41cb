//! Measurement engine of the host: plugin loading, the pipeline of a plant, and the evaluation of one stroke.
//!
//! | module | contents |
//! |---|---|
//! | `plugin` | plugin libraries: found by name, checked, loaded; scanner, flattening, comparison and advisor behind safe types |
//! | `pipeline` | the plugins of one plant file, configured, and the place of the scanner |
//! | `calibration` | the calibration file of a scanner and the conditions under which it is valid |
//! | `doubtful_edge` | verdicts that depend on a doubtful edge, withdrawn |
//! | `scanner_error` | the scanner's error in every uncertainty: from its calibration, or from the range error of its data sheet |
//! | `stroke` | one stroke in the order of its data: scan, patch, outline, measurement, reports, verdict |
//!
//! Another program that measures plates links this crate; `platen` adds the press, the record and the command line.

pub mod calibration;
pub mod doubtful_edge;
pub mod pipeline;
pub mod plugin;
pub mod scanner_error;
pub mod stroke;
