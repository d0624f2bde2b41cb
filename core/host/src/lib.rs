//! Measures plates on a press: loads plugins, runs strokes, command line.
