//! Scanner driver for the simulated cell.
