//! Program platen-sim: simulated press, scanner or both on one plate.
