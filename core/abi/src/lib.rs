//! The C tables that cross a library boundary. `include/platen.h` says the same in C.
//!
//! A plugin is a shared library with one exported data symbol, [`ENTRY_SYMBOL`], of type [`Entry`]; everything
//! else is reached from it. The major number of the boundary is in the symbol's name; within a major version
//! structs grow only at their end and begin with `struct_size`, so that either side can be the older one: a
//! reader uses what both sides have.
//!
//! - Memory of data belongs to the host: the plugin asks for a buffer, fills it, emits it. Inputs are read-only.
//! - Calls marked `[inst]` of one instance are serialised and always come from the same thread; those marked
//!   `[any]` may come from any thread at any time.
//! - No exception and no panic crosses the boundary. Strings are UTF-8 with a NUL at the end.
//! - Lengths are metres, angles radians, times nanoseconds or seconds as named.
//!
//! Payloads (what a [`Frame`]'s buffer holds) are described in [`payload`].
#![allow(unsafe_code, reason = "this crate is the boundary: it casts between bytes and repr(C) structs")]

pub mod payload;
mod table;

pub use table::*;

/// Symbol that a plugin library exports: a constant of type [`Entry`].
pub const ENTRY_SYMBOL: &std::ffi::CStr = c"platen_entry_1";

/// Minor version of the boundary described here.
pub const ABI_MINOR: u32 = 0;
