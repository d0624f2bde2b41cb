//! Schema of the database: numbered SQL files, applied in order, each once, by the owner of the database.
//!
//! Later versions only add to the schema: hosts of an older release continue with the same statement.

use platen_plant::SinkUse;
use tokio_postgres::Client;

use crate::postgresql::{self, configuration};
use crate::{ForwardError, tls};

/// A numbered file.
#[derive(Debug, Clone, Copy)]
pub struct Migration {
    /// Number, from 1.
    pub number: i32,
    /// Name of the file.
    pub name: &'static str,
    /// Its SQL.
    pub sql: &'static str,
}

/// All files, in order.
pub const MIGRATIONS: [Migration; 3] = [
    Migration { number: 1, name: "001-inbox.sql", sql: include_str!("../sql/001-inbox.sql") },
    Migration { number: 2, name: "002-tables.sql", sql: include_str!("../sql/002-tables.sql") },
    Migration { number: 3, name: "003-questions.sql", sql: include_str!("../sql/003-questions.sql") },
];

/// Lock taken before a file is applied to a database to which hosts write. A host locks the inbox first and then the
/// tables that its triggers fill; a file that locked those tables first would deadlock with the host.
const LOCK_INBOX: &str = "LOCK TABLE platen.inbox IN SHARE ROW EXCLUSIVE MODE;";

/// Failure of a migration; the database is unchanged.
#[derive(Debug, thiserror::Error)]
pub enum SchemaError {
    /// A file that the plant file names.
    #[error(transparent)]
    File(#[from] ForwardError),
    /// The server cannot be reached.
    #[error("{0}")]
    Unavailable(String),
    /// A file cannot be applied.
    #[error("{name}: {why}; nothing of it was applied")]
    Migration {
        /// The file.
        name: &'static str,
        /// Reason.
        why: String,
    },
}

/// Returns the SQL of all files as one script for `psql -1`.
#[must_use]
pub fn script() -> String {
    MIGRATIONS.iter().map(|it| format!("-- {}\n{}{}\n", it.name, it.sql, noted(it))).collect()
}

fn noted(migration: &Migration) -> String {
    format!(
        "INSERT INTO platen.migration (number, name) VALUES ({}, '{}');\n",
        migration.number, migration.name
    )
}

/// Applies the files that are missing in the database, each in a transaction, and returns them. `sink` identifies the
/// server; its user and password are those of the owner.
///
/// # Errors
/// [`SchemaError`].
pub async fn apply(sink: &SinkUse) -> Result<Vec<&'static Migration>, SchemaError> {
    let unavailable = |e: tokio_postgres::Error| {
        SchemaError::Unavailable(format!("{}:{}: {}", sink.host, sink.port, postgresql::chain(&e)))
    };
    let (config, tls) = (configuration(sink)?, tls::config(sink)?);
    let (client, task) =
        postgresql::open(&config, tls, &postgresql::Warnings::default()).await.map_err(unavailable)?;
    let applied = apply_all(&client).await;
    task.abort();
    applied
}

async fn apply_all(client: &Client) -> Result<Vec<&'static Migration>, SchemaError> {
    let unavailable = |e: tokio_postgres::Error| SchemaError::Unavailable(postgresql::chain(&e));
    let there = client
        .query_one("SELECT to_regclass('platen.migration') IS NOT NULL", &[])
        .await
        .map_err(unavailable)?;
    let last: i32 = match there.get(0) {
        false => 0,
        true => {
            let row = client.query_one("SELECT coalesce(max(number), 0) FROM platen.migration", &[]).await;
            row.map_err(unavailable)?.get(0)
        }
    };
    let mut applied = Vec::new();
    for migration in MIGRATIONS.iter().filter(|it| it.number > last) {
        let lock = if migration.number > 1 { LOCK_INBOX } else { "" };
        let sql = format!("BEGIN;\n{lock}\n{}\n{}COMMIT;", migration.sql, noted(migration));
        let failed = |e: tokio_postgres::Error| SchemaError::Migration {
            name: migration.name,
            why: postgresql::chain(&e),
        };
        client.batch_execute(&sql).await.map_err(failed)?;
        applied.push(migration);
    }
    Ok(applied)
}
