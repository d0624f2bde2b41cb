//! Files written by others, and what happens to files that are not sound.

mod collect;
mod samples;
