//! Output of conformance tests: one line for each outcome as it arrives, the totals, and JUnit's XML.

use std::path::Path;
use std::process::ExitCode;

use platen_conformance::{Outcome, Verdict, junit};

use super::{CliError, Common, output};

/// Prints an outcome, and after a failure the command that repeats it.
pub(super) fn print(common: &Common, outcome: &Outcome, again: &str) -> Result<(), CliError> {
    if common.json {
        return Ok(());
    }
    let (word, why) = match &outcome.verdict {
        Verdict::Passed => ("ok", None),
        Verdict::Warned(why) => ("warning", Some(why)),
        Verdict::Failed(why) => ("FAILED", Some(why)),
        Verdict::LeftOut(why) => ("left out", Some(why)),
    };
    output::line(&format!("{:8} {:20} {}", word, outcome.test, outcome.demands))?;
    if let Some(why) = why {
        output::line(&format!("         {why}"))?;
    }
    if matches!(outcome.verdict, Verdict::Failed(_)) {
        output::line(&format!("         again: {again}"))?;
    }
    Ok(())
}

/// Prints the totals, writes the XML, and returns 1 if a test has failed. `what` is the tested object, `key` its name
/// in the JSON, `kit` the version of the tests.
pub(super) fn sum(
    common: &Common,
    (key, what, kit): (&str, &str, &str),
    outcomes: &[Outcome],
    file: Option<&Path>,
) -> Result<ExitCode, CliError> {
    if outcomes.is_empty() {
        return Err(CliError::Usage("no test has such a name; without --only all are run".into()));
    }
    if let Some(file) = file {
        std::fs::write(file, junit(what, outcomes))
            .map_err(|why| CliError::Failed(format!("{}: {why}; choose another file", file.display())))?;
    }
    let count = |wanted: fn(&Verdict) -> bool| outcomes.iter().filter(|it| wanted(&it.verdict)).count();
    let failed = count(|verdict| matches!(verdict, Verdict::Failed(_)));
    if common.json {
        output::json(&serde_json::json!({ key: what, "failed": failed, "tests": outcomes }))?;
    } else {
        let passed = count(|verdict| matches!(verdict, Verdict::Passed));
        let warned = count(|verdict| matches!(verdict, Verdict::Warned(_)));
        let left_out = count(|verdict| matches!(verdict, Verdict::LeftOut(_)));
        let text = format!("{passed} passed, {failed} failed, {warned} warnings, {left_out} left out");
        output::line(&format!("{what}: {text}, platen {}, {kit}", env!("CARGO_PKG_VERSION")))?;
    }
    Ok(ExitCode::from(u8::from(failed > 0)))
}
