//! Golden test of all messages about faulty files: `golden/NAME.toml` against `golden/NAME.faults`.
//!
//! `PLATEN_BLESS=1 cargo test -p platen-plant` writes the messages again; review them before committing.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that fails may panic")]

use std::path::{Path, PathBuf};

use platen_plant::{Faults, PlantFile, PlateFile};

#[test]
fn every_fault_of_every_golden_file_is_reported_as_read_in_review() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&folder).unwrap().map(|file| file.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    let mut wrong = Vec::new();
    for path in &files {
        let name = path.file_name().unwrap().to_str().unwrap();
        let found = faults(name, &std::fs::read_to_string(path).unwrap());
        let golden = path.with_extension("faults");
        if std::env::var_os("PLATEN_BLESS").is_some() {
            std::fs::write(&golden, &found).unwrap();
        }
        let expected = std::fs::read_to_string(&golden).unwrap_or_default();
        if found != expected {
            wrong.push(format!("{name}\nexpected:\n{expected}found:\n{found}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(files.len() >= 10, "only {} golden files found", files.len());
}

fn faults(name: &str, text: &str) -> String {
    let faults: Faults = match name.starts_with("plant-") {
        true => PlantFile::parse(name, text).expect_err(name),
        false => PlateFile::parse(name, text).expect_err(name),
    };
    format!("{faults}\n")
}
