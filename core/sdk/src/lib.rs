//! For plugin authors: Scanner, Flattening, Comparison, options, export!.
