//! Flattening by harmonic map.
