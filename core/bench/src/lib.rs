//! Benchmark program `platen-bench`, started by `platen bench` and `platen press soak`; it is not needed on a plant's
//! computer.
//!
//! | module | contents |
//! |---|---|
//! | `bench` | command line of `platen bench` |
//! | `tables` | tables 1 to 4 of Masuda et al., "Point-based shape monitoring of plate bending for large-scale storage tanks", beside this machine's figures |
//! | `seeds`, `strokes` | accuracy over many seeds: plates of every shape, strokes, templates |
//! | `random` | accuracy over random scenes, coverage of the stated intervals |
//! | `advice` | simulated plates of unknown steel, bent by the advice and by strategies of a shop |
//! | `scale` | time and memory from 1.6 to 44 million cells |
//! | `soak` | strokes against a simulated press on a faulty line |
//! | `accuracy` | the difference of a measurement from the known truth |
//! | `scene`, `stages`, `figures`, `machine` | simulated scans, timed stages, statistics, the computer |

pub mod accuracy;
mod advice;
mod bench;
mod figures;
mod machine;
mod random;
mod scale;
mod scene;
mod seeds;
mod soak;
mod stages;
mod strokes;
mod tables;

use std::process::ExitCode;

use platen_host::cli::{self, BenchVerb};

/// Runs the command line.
pub fn main() -> ExitCode {
    cli::main_of_bench(|common, verb| match verb {
        BenchVerb::Bench(arguments) => bench::run(common, arguments),
        BenchVerb::Soak(arguments) => soak::run(common, arguments),
    })
}
