//! Helpers of the tests: builds the workspace once, finds programs, libraries and samples.
