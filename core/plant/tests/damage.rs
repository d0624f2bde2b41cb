//! Fuzz test with randomly damaged files: the reader never panics, always gives a reason, and every reason has a place.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

use platen_plant::{Faults, PlantFile, PlateFile};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

const PLATE: &str = include_str!("../../../config/plates/plate-017.toml");
const PLANT: &str = include_str!("../../../config/plant-faro-file.toml");

/// One typing error.
#[derive(Debug, Clone)]
enum Slip {
    Delete,
    Double,
    Insert(&'static str),
}

fn slips() -> impl Strategy<Value = Vec<(Slip, usize, usize)>> {
    let junk =
        ["\"", "'", "[", "]", "{", "}", "=", "\n", "#", ".", ",", "é", "\u{feff}", "-", "\"\"\"", "[[", "\r"];
    let slip = prop_oneof![
        Just(Slip::Delete),
        Just(Slip::Double),
        proptest::sample::select(junk.to_vec()).prop_map(Slip::Insert),
    ];
    proptest::collection::vec((slip, 0..usize::MAX, 0..40_usize), 1..4)
}

fn damage(text: &str, slips: &[(Slip, usize, usize)]) -> String {
    let mut letters: Vec<char> = text.chars().collect();
    for (slip, at, length) in slips {
        let at = at % (letters.len() + 1);
        let end = (at + length).min(letters.len());
        match slip {
            Slip::Delete => drop(letters.drain(at..end)),
            Slip::Double => {
                let copy = letters[at..end].to_vec();
                letters.splice(end..end, copy);
            }
            Slip::Insert(junk) => drop(letters.splice(at..at, junk.chars())),
        }
    }
    letters.into_iter().collect()
}

fn check(text: &str, result: Result<(), Faults>) -> Result<(), TestCaseError> {
    let valid_toml = text.parse::<toml::Table>().is_ok();
    let Err(faults) = result else {
        prop_assert!(valid_toml, "broken TOML was accepted");
        return Ok(());
    };
    let lines: Vec<&str> = text.split('\n').collect();
    prop_assert!(!faults.as_slice().is_empty());
    prop_assert!(faults.as_slice().is_sorted());
    for fault in faults {
        prop_assert!(!fault.message.is_empty() && !fault.message.contains('\n'), "{}", fault);
        prop_assert!(fault.message != "cannot be read", "a refusal without a word");
        prop_assert!((1..=lines.len()).contains(&fault.line), "{}", fault);
        let width = lines[fault.line - 1].chars().count();
        prop_assert!((1..=width + 1).contains(&fault.column), "{} in a line of {}", fault, width);
    }
    Ok(())
}

#[test]
fn damaged_files_are_refused_with_a_reason_or_read() {
    // A fixed seed: the same damage on every machine.
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[17; 32]);
    let config = Config { cases: 3000, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, rng);
    let result = runner.run(&slips(), |slips| {
        let text = damage(PLATE, &slips);
        check(&text, PlateFile::parse("plate.toml", &text).map(drop))?;
        let text = damage(PLANT, &slips);
        check(&text, PlantFile::parse("plant.toml", &text).map(drop))
    });
    result.unwrap();
}
