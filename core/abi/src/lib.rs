//! C tables that cross a library boundary.
