//! Strokes, plates and journal in SQLite.
