//! C boundary between platen and its plugins: function tables, descriptors and payload headers.
//!
//! `include/platen.h` is the same boundary in C.
//!
//! A plugin is a shared library that exports one data symbol, [`ENTRY_SYMBOL`], of type [`Entry`]. The host reaches
//! everything else through it.
//!
//! # Versions
//!
//! The major version is part of the symbol's name. Within a major version structs begin with `struct_size` and grow
//! only at their end, so either side may be the older one. A reader takes the members that both sides have, and zero
//! for the rest ([`Table::read`], [`payload::read`]). [`ABI_MINOR`] is the minor version; payload formats have their
//! own version in their name (`platen.mesh/2`).
//!
//! # Rules
//!
//! - Memory of frames belongs to the host: a plugin requests a buffer, fills it, and emits or frees it. Inputs are
//!   read-only.
//! - `[inst]` calls of one instance are serialised and always come from the same thread. `[any]` calls may come from
//!   any thread at any time.
//! - No exception and no panic MAY cross the boundary. Strings are UTF-8 with a terminating NUL.
//! - A plugin MUST NOT change the state of the process: signals, standard input and output, working folder, locale,
//!   rounding mode.
//! - Lengths are in metres, angles in radians, times in nanoseconds or seconds as named.
//!
//! [`payload`] describes the contents of a [`Frame`]'s buffer.
#![allow(unsafe_code, reason = "this crate is the boundary: it casts between bytes and repr(C) structs")]

pub mod payload;
mod table;

pub use table::*;

/// Name of the exported constant of type [`Entry`].
pub const ENTRY_SYMBOL: &std::ffi::CStr = c"platen_entry_2";

/// Minor version of the boundary.
pub const ABI_MINOR: u32 = 0;
