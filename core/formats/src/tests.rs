//! Tests with files written by other programs, one lattice in every encoding, and files that are not sound.

mod collect;
mod damage;
mod faults;
mod files;
mod formats;
mod samples;
mod speed;
mod write;
