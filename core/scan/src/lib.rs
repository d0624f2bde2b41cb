//! Lattice of a terrestrial laser scan: columns, cell states, directions, header and trailer.
//!
//! A terrestrial laser scanner turns a mirror about a horizontal axis (one *column* per sweep) while its head turns
//! about the vertical (one azimuth per column). The cells therefore form a lattice with `n_rows` x `n_columns` places,
//! most of them filled.
//!
//! All quantities are in the scanner frame: right-handed, z up, origin at the mirror; metres, radians; azimuth
//! counter-clockwise from +x seen from above, elevation up from the horizontal. Row 0 is at the top, columns run by
//! increasing azimuth. Drivers deliver every scan in this order.
//!
//! This crate does no I/O and has no file format; those are in `platen-formats`.

mod angle;
mod column;
mod data_sheet;
mod lattice;
mod scan;

pub use angle::{Direction, Window, wrap_azimuth};
pub use column::{Column, ColumnError, Face, State};
pub use data_sheet::data_sheet_range_error_m;
pub use lattice::Lattice;
pub use scan::{Outcome, ScanEnd, ScanHeader};
