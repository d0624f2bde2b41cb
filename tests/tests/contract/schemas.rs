//! Consistency of the JSON schemas beside the header with the types that cross the boundary.

use std::path::Path;

use platen_model::{Advice, Findings, PlateHistory, Task};
use schemars::generate::{SchemaGenerator, SchemaSettings};

/// Compares a schema with its file, or writes it (`PLATEN_BLESS=1`).
fn stands_beside_the_header(name: &str, schema: schemars::Schema) {
    let mut schema = serde_json::to_value(schema).unwrap();
    schema["$id"] = serde_json::json!(name);
    let text = format!("{schema:#}\n");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../core/abi/include/{name}.json"));
    if std::env::var_os("PLATEN_BLESS").is_some() {
        std::fs::write(&file, &text).unwrap();
    }
    let found = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(found == text, "{}: not the schema of the type; PLATEN_BLESS=1 writes it", file.display());
}

#[test]
fn the_task_has_a_schema() {
    // In the form that the host writes.
    let generator = SchemaGenerator::new(SchemaSettings::draft2020_12().for_serialize());
    stands_beside_the_header("platen.task-1", generator.into_root_schema_for::<Task>());
}

#[test]
fn the_findings_have_a_schema() {
    // In the form that the host reads.
    let generator = SchemaGenerator::new(SchemaSettings::draft2020_12().for_deserialize());
    stands_beside_the_header("platen.findings-1", generator.into_root_schema_for::<Findings>());
}

#[test]
fn the_record_has_a_schema() {
    // In the form that the host writes.
    let generator = SchemaGenerator::new(SchemaSettings::draft2020_12().for_serialize());
    stands_beside_the_header("platen.record-1", generator.into_root_schema_for::<PlateHistory>());
}

#[test]
fn the_advice_has_a_schema() {
    // In the form that the host reads.
    let generator = SchemaGenerator::new(SchemaSettings::draft2020_12().for_deserialize());
    stands_beside_the_header("platen.advice-1", generator.into_root_schema_for::<Advice>());
}
