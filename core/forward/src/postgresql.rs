//! PostgreSQL sink: messages are inserted into `platen.inbox`; triggers on the server fill the tables for queries.
//!
//! A host may execute only this one statement, the same in all releases. Hosts of several releases can therefore write
//! at the same time, and a migration takes place in one place (`sql/`). The server ignores a message that it already
//! has. It reports other cases in warnings, [`APART`] and [`CONFLICT`].

use std::error::Error as _;
use std::future::poll_fn;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use platen_history::Owner;
use platen_plant::SinkUse;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::task::JoinHandle;
use tokio_postgres::config::SslMode;
use tokio_postgres::error::DbError;
use tokio_postgres::{AsyncMessage, Client, Config, Connection, NoTls, Statement};
use tokio_postgres_rustls::MakeRustlsConnect;

use crate::message::{Message, Names};
use crate::sink::{ANSWER, Receipt, Sink, SinkError};
use crate::{ForwardError, tls};

/// Inserts a batch: one row an element of the arrays.
const INSERT: &str = "\
    INSERT INTO platen.inbox (site, press, writer, former, owner, kind, id, at, sha256, doc) \
    SELECT $1, $2, $3, $4, t.owner, t.kind, t.id, t.at::timestamptz, t.sha256, t.doc::jsonb \
    FROM unnest($5::int[], $6::text[], $7::bigint[], $8::text[], $9::text[], $10::text[]) \
    AS t (owner, kind, id, at, sha256, doc) ON CONFLICT DO NOTHING";

/// Beginning of the warning that the server keeps messages separate or has seen another host under the same name.
const APART: &str = "platen apart: ";
/// Beginning of the warning that a message differs from one under the same key.
const CONFLICT: &str = "platen conflict: ";

/// Largest number of messages of one insert.
const BATCH: u32 = 100;

pub(crate) type Warnings = Arc<Mutex<Vec<String>>>;

/// Sink of a PostgreSQL server.
pub(crate) struct PostgresqlSink {
    config: Config,
    tls: Option<rustls::ClientConfig>,
    place: String,
    names: Names,
    session: Option<Session>,
}

/// Connection with its statement.
struct Session {
    client: Client,
    insert: Statement,
    warnings: Warnings,
    task: JoinHandle<()>,
}

impl Drop for Session {
    fn drop(&mut self) {
        self.task.abort();
    }
}

impl PostgresqlSink {
    pub(crate) fn new(sink: &SinkUse, names: &Names) -> Result<Self, ForwardError> {
        let tls = tls::config(sink)?;
        Ok(Self {
            config: configuration(sink)?,
            place: format!("{}:{}", sink.host, sink.port),
            names: names.clone(),
            session: None,
            tls,
        })
    }

    async fn open(&self) -> Result<Session, SinkError> {
        let warnings = Warnings::default();
        let (client, task) =
            open(&self.config, self.tls.clone(), &warnings).await.map_err(|e| self.explain(&e))?;
        let insert = client.prepare(INSERT).await;
        match insert {
            Ok(insert) => Ok(Session { client, insert, warnings, task }),
            Err(error) => {
                task.abort();
                Err(self.explain(&error))
            }
        }
    }

    /// Returns an error with the action to take.
    fn explain(&self, error: &tokio_postgres::Error) -> SinkError {
        let place = &self.place;
        let Some(db) = error.as_db_error() else {
            return SinkError::Unavailable(format!("{place}: {}", chain(error)));
        };
        let (code, said) = (db.code().code(), db.message());
        let sentence = |why: String| SinkError::Unavailable(format!("{place}: {why}"));
        match (&code[..2], code) {
            ("22" | "23", _) => SinkError::Refused(said.to_owned()),
            ("28", _) => sentence(format!("{said}; look at user and password_file")),
            (_, "3D000") => sentence(format!("{said}; look at the key database")),
            (_, "3F000" | "42P01" | "42703") => {
                sentence(format!("{said}; the owner of the database runs `platen forward schema --apply`"))
            }
            (_, "42501") => sentence(format!("{said}; a host writes as SITE/PRESS, a role in platen_writer")),
            _ => sentence(format!("{said} ({code})")),
        }
    }
}

/// Returns the settings of the connection.
pub(crate) fn configuration(sink: &SinkUse) -> Result<Config, ForwardError> {
    let mut config = Config::new();
    config.host(&sink.host).port(sink.port).dbname(&sink.database).user(&sink.user);
    config
        .application_name("platen forward")
        .connect_timeout(ANSWER)
        .keepalives_idle(Duration::from_secs(30));
    config.ssl_mode(if sink.tls { SslMode::Require } else { SslMode::Disable });
    if let Some(password) = tls::password(sink)? {
        config.password(password);
    }
    Ok(config)
}

/// Connects. A task drives the connection and collects the server's warnings.
pub(crate) async fn open(
    config: &Config,
    tls: Option<rustls::ClientConfig>,
    warnings: &Warnings,
) -> Result<(Client, JoinHandle<()>), tokio_postgres::Error> {
    match tls {
        Some(tls) => {
            let (client, connection) = config.connect(MakeRustlsConnect::new(tls)).await?;
            Ok((client, tokio::spawn(carry(connection, Arc::clone(warnings)))))
        }
        None => {
            let (client, connection) = config.connect(NoTls).await?;
            Ok((client, tokio::spawn(carry(connection, Arc::clone(warnings)))))
        }
    }
}

async fn carry<S, T>(mut connection: Connection<S, T>, warnings: Warnings)
where
    S: AsyncRead + AsyncWrite + Unpin,
    T: AsyncRead + AsyncWrite + Unpin,
{
    // The client notices the end at its next request.
    while let Some(Ok(message)) = poll_fn(|context| connection.poll_message(context)).await {
        if let AsyncMessage::Notice(notice) = message {
            warnings
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .push(DbError::message(&notice).to_owned());
        }
    }
}

/// Returns an error with its causes.
pub(crate) fn chain(error: &tokio_postgres::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text += &format!(": {cause}");
        source = cause.source();
    }
    text
}

/// Returns the receipt that follows from the warnings of a batch.
fn receipt(warnings: &[String]) -> Receipt {
    let conflicts = warnings.iter().filter(|it| it.starts_with(CONFLICT)).count();
    let apart = warnings.iter().find_map(|it| it.strip_prefix(APART)).map(str::to_owned);
    Receipt { apart, conflicts: u64::try_from(conflicts).unwrap_or_default() }
}

impl Sink for PostgresqlSink {
    async fn connect(&mut self) -> Result<(), SinkError> {
        self.session = None;
        let session = tokio::time::timeout(2 * ANSWER, self.open()).await;
        self.session = Some(session.map_err(|_| SinkError::silent(&self.place))??);
        Ok(())
    }

    async fn deliver(&mut self, messages: &[Message], owners: &[Owner]) -> Result<Receipt, SinkError> {
        let Some(session) = self.session.as_ref().filter(|it| !it.client.is_closed()) else {
            return Err(SinkError::Unavailable(format!("{}: the server closed the connection", self.place)));
        };
        let mut former: Vec<i32> = owners.iter().map(|it| i32::from(it.owner)).collect();
        let writer = former.pop().unwrap_or_default();
        let owners: Vec<i32> = messages.iter().map(|it| i32::from(it.key.owner)).collect();
        let kinds: Vec<&str> = messages.iter().map(|it| it.key.kind.as_str()).collect();
        let ids: Vec<i64> = messages.iter().map(|it| i64::try_from(it.key.id).unwrap_or(i64::MAX)).collect();
        let times: Vec<&str> = messages.iter().map(|it| it.at.as_str()).collect();
        let hashes: Vec<&str> = messages.iter().map(|it| it.sha256.as_str()).collect();
        let texts: Vec<&str> = messages.iter().map(|it| it.text.as_str()).collect();
        session.warnings.lock().unwrap_or_else(PoisonError::into_inner).clear();
        let values: [&(dyn tokio_postgres::types::ToSql + Sync); 10] = [
            &self.names.site,
            &self.names.press,
            &writer,
            &former,
            &owners,
            &kinds,
            &ids,
            &times,
            &hashes,
            &texts,
        ];
        let inserted = tokio::time::timeout(ANSWER, session.client.execute(&session.insert, &values)).await;
        inserted.map_err(|_| SinkError::silent(&self.place))?.map_err(|e| self.explain(&e))?;
        Ok(receipt(&session.warnings.lock().unwrap_or_else(PoisonError::into_inner)))
    }

    async fn idle(&mut self, time: Duration) -> Result<(), SinkError> {
        tokio::time::sleep(time).await;
        match &self.session {
            Some(session) if !session.client.is_closed() => Ok(()),
            _ => Err(SinkError::Unavailable(format!("{}: the server closed the connection", self.place))),
        }
    }

    async fn close(&mut self) {
        self.session = None;
    }

    fn batch(&self) -> u32 {
        BATCH
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_become_a_receipt() {
        let said =
            ["platen conflict: 7 finished 3", "platen apart: taken", "platen conflict: 7 acked 3", "other"];
        let found = receipt(&said.map(str::to_owned));
        assert_eq!(found, Receipt { apart: Some("taken".to_owned()), conflicts: 2 });
    }
}
