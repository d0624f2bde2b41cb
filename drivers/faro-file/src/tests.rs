//! Tests of the driver without a host.

mod watching;
