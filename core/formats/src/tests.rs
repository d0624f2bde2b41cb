//! Files written by others, the same lattice in every way of writing it, and files that are not sound.

mod collect;
mod damage;
mod faults;
mod files;
mod formats;
mod samples;
mod speed;
mod write;
