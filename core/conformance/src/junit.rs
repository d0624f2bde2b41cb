//! Outcomes of tests as JUnit's XML, which CI systems read.

use maud::{PreEscaped, html};

use crate::{Outcome, Verdict};

/// Returns the report of a library.
#[must_use]
pub fn junit(library: &str, outcomes: &[Outcome]) -> String {
    let count = |wanted: fn(&Verdict) -> bool| outcomes.iter().filter(|it| wanted(&it.verdict)).count();
    let failed = count(|verdict| matches!(verdict, Verdict::Failed(_)));
    let left_out = count(|verdict| matches!(verdict, Verdict::LeftOut(_)));
    let suite = html! {
        (PreEscaped("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"))
        testsuite name=(library) tests=(outcomes.len()) failures=(failed) skipped=(left_out) {
            @for outcome in outcomes {
                testcase classname=(format!("level {}", outcome.level)) name=(outcome.test) time=(format!("{:.3}", outcome.seconds)) {
                    @match &outcome.verdict {
                        Verdict::Passed => {}
                        Verdict::Warned(why) => { system-out { (why) } }
                        Verdict::Failed(why) => { failure message=(why) { (outcome.demands) } }
                        Verdict::LeftOut(why) => { skipped message=(why) {} }
                    }
                }
            }
        }
    };
    suite.into_string()
}
