//! Conformance tests of a plugin library, for `platen plugins check`: tests of the boundary's contract, each in a
//! worker process of its own.
//!
//! [`run_bridge`] runs the tests of a scan bridge over TCP, for `platen bridge check`.
//!
//! | level | contents |
//! |---|---|
//! | 0 | the file, without running any of its code |
//! | 1 | loading and description |
//! | 2 | the contract: options, reference inputs, equal answers, plausible answers |
//! | 3 | abuse: deadlines, cancellation, hard inputs, leaks |
//!
//! A test whose prerequisites are missing (options without a default, a device) is left out with the reason. It proves
//! nothing.

mod answer;
mod bridge;
mod junit;
mod reference;
mod subject;
mod tests;

use std::time::Instant;

use serde::Serialize;

pub use bridge::{BridgeSubject, run_bridge};
pub use junit::junit;
pub use subject::{Settings, Subject, SubjectError};

/// Highest level.
pub const LEVELS: u8 = 3;

/// Result of one test.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The plugin complies with this part of the contract.
    Passed,
    /// It complies, but in a way that may cause trouble: the reason.
    Warned(String),
    /// It does not comply: its behaviour.
    Failed(String),
    /// Not tested: the missing prerequisite.
    LeftOut(String),
}

/// Test that was run.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// Name, as for `--only`.
    pub test: &'static str,
    /// Level.
    pub level: u8,
    /// Requirement of the contract.
    pub demands: &'static str,
    /// Result.
    pub verdict: Verdict,
    /// Duration, seconds.
    pub seconds: f64,
}

/// A test.
#[derive(Debug, Clone, Copy)]
struct Test {
    name: &'static str,
    level: u8,
    demands: &'static str,
    run: fn(&Subject) -> Result<(), Verdict>,
}

impl Test {
    fn left_out(&self, why: String) -> Outcome {
        let verdict = Verdict::LeftOut(why);
        Outcome { test: self.name, level: self.level, demands: self.demands, verdict, seconds: 0.0 }
    }

    fn run(&self, subject: &Subject) -> Outcome {
        let start = Instant::now();
        let verdict = (self.run)(subject).err().unwrap_or(Verdict::Passed);
        let seconds = start.elapsed().as_secs_f64();
        Outcome { test: self.name, level: self.level, demands: self.demands, verdict, seconds }
    }
}

/// Names of the tests without which the later tests of levels 2 and 3 prove nothing.
const GATES: [&str; 4] = ["load.loads", "options.default", "answer.given", "answer.same"];

/// Runs the tests up to a level whose names contain `only`, and reports each.
pub fn run(
    subject: &Subject,
    level: u8,
    only: Option<&str>,
    mut report: impl FnMut(&Outcome),
) -> Vec<Outcome> {
    let (mut outcomes, mut shut): (Vec<Outcome>, Option<&str>) = (Vec::new(), None);
    let wanted = tests::ALL.iter().copied().flatten().filter(|test| test.level <= level);
    let wanted = wanted.filter(|test| subject.kind().map_or(true, |kind| tests::concerns(test.name, kind)));
    for test in wanted.filter(|test| only.is_none_or(|only| test.name.contains(only))) {
        let outcome = match shut {
            Some(gate) if test.level >= 2 => test.left_out(format!("{gate} has not passed")),
            _ => test.run(subject),
        };
        let passed = matches!(outcome.verdict, Verdict::Passed | Verdict::Warned(_));
        let left_out = matches!(outcome.verdict, Verdict::LeftOut(_));
        // No two scans of a device are equal, which is not a fault of its driver.
        if GATES.contains(&test.name) && !passed && !(left_out && test.name == "answer.same") {
            shut = shut.or(Some(test.name));
        }
        report(&outcome);
        outcomes.push(outcome);
    }
    outcomes
}

/// Returns a digest of the plugin's answers to the reference inputs, hexadecimal: equal in both isolations.
///
/// # Errors
/// The plugin's error as a sentence, if it gave no answer.
pub fn digest(subject: &Subject) -> Result<String, String> {
    answer::digest(subject).map_err(|error| error.to_string())
}
