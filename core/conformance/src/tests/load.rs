//! Tests of level 1: loading and description.

use std::collections::BTreeSet;
use std::time::Duration;

use platen_engine::plugin::{Library, LoadFacts};

use crate::subject::{Subject, failed};
use crate::{Test, Verdict};

/// Slower than this, listing the plugins takes too long.
const SLOW: Duration = Duration::from_millis(100);

pub(super) const TESTS: &[Test] = &[
    Test {
        name: "load.loads",
        level: 1,
        demands: "the library loads, initialises and describes its plugins",
        run: |subject| subject.library.as_ref().map(drop).map_err(failed),
    },
    Test { name: "load.quick", level: 1, demands: "within 100 ms", run: quick },
    Test {
        name: "load.silent",
        level: 1,
        demands: "without a word on standard output or error",
        run: silent,
    },
    Test { name: "load.threads", level: 1, demands: "without threads of its own", run: threads },
    Test { name: "load.same", level: 1, demands: "a second time with the same description", run: same },
    Test {
        name: "load.words",
        level: 1,
        demands: "maker, version, purpose and licence are given",
        run: words,
    },
    Test {
        name: "load.options",
        level: 1,
        demands: "options differ in name, are explained, and take their defaults",
        run: options,
    },
];

fn facts(subject: &Subject) -> Result<&LoadFacts, Verdict> {
    subject.library().map(Library::facts)
}

fn quick(subject: &Subject) -> Result<(), Verdict> {
    let took = facts(subject)?.took;
    if took < SLOW { Ok(()) } else { Err(Verdict::Warned(format!("it took {} ms", took.as_millis()))) }
}

fn silent(subject: &Subject) -> Result<(), Verdict> {
    match &facts(subject)?.printed {
        None => Ok(()),
        Some(line) => Err(failed(format!("it printed {line:?}; use the host's log"))),
    }
}

fn threads(subject: &Subject) -> Result<(), Verdict> {
    match facts(subject)?.threads {
        0 | 1 => Ok(()),
        n => Err(failed(format!("{} threads run after loading; start them in open or run", n - 1))),
    }
}

fn same(subject: &Subject) -> Result<(), Verdict> {
    let first = subject.descriptor()?;
    let again = subject.catalogue.open(&subject.path).map_err(failed)?;
    if again.iter().any(|library| library.descriptor() == first) {
        Ok(())
    } else {
        Err(failed("it describes itself differently the second time"))
    }
}

fn words(subject: &Subject) -> Result<(), Verdict> {
    let about = subject.descriptor()?;
    let given = [
        ("vendor", &about.vendor),
        ("version", &about.version),
        ("doc", &about.doc),
        ("license", &about.license),
    ];
    match given.iter().find(|(_, text)| text.trim().is_empty()) {
        None => Ok(()),
        Some((name, _)) => Err(failed(format!("its {name} is empty"))),
    }
}

fn options(subject: &Subject) -> Result<(), Verdict> {
    let mut names = BTreeSet::new();
    for option in &subject.descriptor()?.options {
        let name = &option.name;
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if !name.starts_with(|c: char| c.is_ascii_lowercase()) || !name.chars().all(plain) {
            return Err(failed(format!("option {name:?}: lower case letters, digits and _ make a key")));
        }
        if !names.insert(name) {
            return Err(failed(format!("two options named {name}")));
        }
        if option.doc.trim().is_empty() {
            return Err(failed(format!("option {name} is not explained")));
        }
        option
            .default_value("its own default")
            .map_err(|faults| failed(format!("option {name}: {faults}")))?;
    }
    Ok(())
}
