//! Tests of level 0: the file, without running any of its code.

use platen_engine::plugin::exported_symbols;

use crate::subject::{Subject, failed};
use crate::{Test, Verdict};

pub(super) const TESTS: &[Test] = &[
    Test {
        name: "file.library",
        level: 0,
        demands: "the file is a whole shared library for this machine",
        run: |subject| exported_symbols(&subject.path).map(drop).map_err(failed),
    },
    Test { name: "file.entry", level: 0, demands: "it exports platen_entry_2", run: entry },
    Test {
        name: "file.exports",
        level: 0,
        demands: "it exports nothing else, which might be taken for another library's",
        run: exports,
    },
];

fn symbols(subject: &Subject) -> Result<Vec<String>, Verdict> {
    exported_symbols(&subject.path).map_err(Verdict::LeftOut)
}

fn entry(subject: &Subject) -> Result<(), Verdict> {
    let entries: Vec<String> =
        symbols(subject)?.into_iter().filter(|name| name.starts_with("platen_entry_")).collect();
    match entries.as_slice() {
        [one] if one == "platen_entry_2" => Ok(()),
        [] => Err(failed("it exports no platen_entry: export the constant by PLATEN_EXPORT")),
        others => Err(failed(format!("it exports {}: build it against this header", others.join(", ")))),
    }
}

/// Symbols that compilers and linkers add on their own.
const USUAL: [&str; 11] = [
    "_ZNSt",
    "_ZNKSt",
    "_ZSt",
    "_ZT",
    "platen_entry_",
    "_init",
    "_fini",
    "_edata",
    "_end",
    "__bss_start",
    "rust_eh_personality",
];

fn exports(subject: &Subject) -> Result<(), Verdict> {
    let usual = |name: &String| USUAL.iter().any(|usual| name.starts_with(usual));
    let others: Vec<String> = symbols(subject)?.into_iter().filter(|name| !usual(name)).collect();
    match others.first() {
        None => Ok(()),
        Some(first) => Err(Verdict::Warned(format!(
            "it also exports {first}{}; build with -fvisibility=hidden",
            match others.len() {
                1 => String::new(),
                n => format!(" and {} others", n - 1),
            }
        ))),
    }
}
