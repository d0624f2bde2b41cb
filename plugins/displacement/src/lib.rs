//! Comparison: displacement between strokes.
