//! Tests of a plugin library, by level.

mod abuse;
mod contract;
mod file;
mod load;

use platen_engine::plugin::Kind;

use crate::Test;

/// All tests, in the order in which they are run.
pub(crate) const ALL: [&[Test]; 4] = [file::TESTS, load::TESTS, contract::TESTS, abuse::TESTS];

/// Returns whether a test applies to plugins of a kind.
pub(crate) fn concerns(test: &str, kind: Kind) -> bool {
    match test {
        "sense.lengths" => kind == Kind::Flattening,
        "sense.figures" => kind == Kind::Comparison,
        "cancel.kept" => kind == Kind::Scanner,
        // There is one device for one driver, and no two scans are equal.
        "answer.again" | "answer.beside" | "input.hard" | "memory.little" => kind != Kind::Scanner,
        _ => true,
    }
}
