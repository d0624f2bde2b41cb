//! Comparison: template gap against the target.
