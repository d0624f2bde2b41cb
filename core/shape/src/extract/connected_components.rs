//! Connected components by union-find over runs of cells, in two uses.
//!
//! - `streaming`: components of the whole lattice under the continuity criterion, joined while columns arrive in any
//!   order.
//! - `labels`: components of a mask inside a window, all at once.

mod labels;
mod streaming;

pub(super) use labels::{NO_LABEL, label_components};
pub(super) use streaming::{Components, Extent, Run};
