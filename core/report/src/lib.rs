//! Output of a measurement: documents, pictures, meshes, tables and the report of a plate.
//!
//! Overview: `core/report/README.md`.
//!
//! | module | contents |
//! |---|---|
//! | `result` | the result document `platen.result/1` |
//! | `picture` | maps, sections and the strip of strokes as SVG; maps for a screen |
//! | `field_export` | the fields of the comparisons as CSV, PLY and VTK |
//! | `output_folder` | the files of one measurement, complete or absent |
//! | `history_view` | recorded strokes in the form for pictures and reports |
//! | `plate_report` | the report of a plate: one HTML file |
//! | `sequence` | bends of a plate in their order, for the comparison of crews |
//!
//! This crate has no access to press, plugins or network.

pub mod advice;
pub mod bend_figures;
pub mod field_export;
pub mod history_view;
pub mod output_folder;
pub mod picture;
pub mod plate_report;
pub mod result;
pub mod sequence;
pub mod skill;
