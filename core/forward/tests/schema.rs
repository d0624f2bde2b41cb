//! Comparison of the JSON schema of the messages, `schema/platen.stroke-1.json`, with the types.
//!
//! `PLATEN_BLESS=1 cargo test -p platen-forward` writes the file anew; check the result before committing it. Consumers
//! rely on every member.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

use platen_forward::message;

#[test]
fn the_schema_of_the_messages_is_that_of_the_types() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("schema/platen.stroke-1.json");
    let made = serde_json::to_string_pretty(&message::schema()).unwrap() + "\n";
    if std::env::var_os("PLATEN_BLESS").is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap_or_default(), made);
}

#[test]
fn the_files_of_the_database_are_numbered_in_order_and_each_is_printed() {
    let script = platen_forward::schema::script();
    for (k, file) in platen_forward::schema::MIGRATIONS.iter().enumerate() {
        assert_eq!(usize::try_from(file.number), Ok(k + 1));
        assert!(
            file.name.starts_with(&format!("{:03}-", k + 1)) && script.contains(file.sql),
            "{}",
            file.name
        );
    }
}
