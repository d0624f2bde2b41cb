//! Closed-form bent plates with thickness and exact material map.
