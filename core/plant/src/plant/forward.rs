//! Table `[forward]`: the destinations of `platen forward` for the recorded strokes, and the names used there.

use std::path::{Path, PathBuf};

use crate::document::{Document, Reported};
use crate::{Located, TomlTable};

/// Words of `type`.
const KINDS: [(&str, SinkKind); 3] =
    [("postgresql", SinkKind::Postgresql), ("mqtt", SinkKind::Mqtt), ("sparkplug", SinkKind::Sparkplug)];

/// Forwarding of the record. Without the table nothing leaves the host.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Forward {
    /// Name of the site, the same for all its presses.
    pub site: String,
    /// Name of the press, unique at its site.
    pub press: String,
    /// Destinations.
    pub sinks: Vec<SinkUse>,
}

/// Kind of a destination.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SinkKind {
    /// A PostgreSQL server with the schema that `platen forward schema` prints.
    Postgresql,
    /// An MQTT 5 broker; JSON at QoS 1.
    Mqtt,
    /// An MQTT broker; Sparkplug B, a live view.
    Sparkplug,
}

impl SinkKind {
    /// Returns the word of the plant file.
    #[must_use]
    pub fn name(self) -> &'static str {
        KINDS.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }

    fn port(self, tls: bool) -> u16 {
        match self {
            Self::Postgresql => 5432,
            Self::Mqtt | Self::Sparkplug if tls => 8883,
            Self::Mqtt | Self::Sparkplug => 1883,
        }
    }
}

/// A destination.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SinkUse {
    /// Name in status and log, unique in the plant file; the kind's where none is given.
    pub name: String,
    /// Kind.
    pub kind: SinkKind,
    /// Host name or address of the server.
    pub host: String,
    /// Port of the server.
    pub port: u16,
    /// Encrypted, with the server verified by its certificate. Without encryption only a server on this computer is
    /// allowed.
    pub tls: bool,
    /// Certificates of the authorities that may sign the server's certificate; those of the system if none is
    /// specified.
    pub ca_file: Option<PathBuf>,
    /// User; `SITE/PRESS` where none is given.
    pub user: String,
    /// File with the password on its first line.
    pub password_file: Option<PathBuf>,
    /// Database, of PostgreSQL.
    pub database: String,
    /// Sparkplug host application whose state determines when past strokes are sent.
    pub primary_host: Option<String>,
}

impl Forward {
    pub(super) fn read(mut table: TomlTable<'_>, folder: &Path) -> Result<Self, Reported> {
        let document = table.document();
        let site = table.name("site").check(is_name).required();
        let press = table.name("press").check(is_name).required();
        let user =
            format!("{}/{}", site.as_deref().unwrap_or_default(), press.as_deref().unwrap_or_default());
        let sinks = table.tables("sink").and_then(|tables| {
            let sinks: Vec<_> = tables.into_iter().map(|table| SinkUse::read(table, folder, &user)).collect();
            sinks.into_iter().collect::<Result<Vec<_>, _>>()
        });
        let place = table.place().clone();
        table.finish();
        let (site, press, sinks) = (site?, press?, sinks?);
        if sinks.is_empty() {
            return Err(document.fault(&place, "has no [[forward.sink]]; name one, or leave [forward] out"));
        }
        once(document, &sinks)?;
        Ok(Self { site, press, sinks: sinks.into_iter().map(|sink| sink.value).collect() })
    }
}

impl SinkUse {
    fn read(mut table: TomlTable<'_>, folder: &Path, user: &str) -> Result<Located<Self>, Reported> {
        let document = table.document();
        let place = table.place().clone();
        let kind = table.choice("type", &KINDS).required();
        let name = table.name("name").check(is_name).optional();
        let host = table.name("host").required();
        let tls = table.bool("tls").or(true);
        let port = table.integer("port").in_range(1..=65_535).optional();
        let ca_file = table.name("ca_file").map(|file| folder.join(file)).optional();
        let user = table.name("user").or(user.to_owned());
        let password_file = table.name("password_file").map(|file| folder.join(file)).optional();
        let of = |wanted: SinkKind| !matches!(kind, Ok(kind) if kind != wanted);
        let database = if of(SinkKind::Postgresql) {
            table.name("database").or("platen".to_owned())
        } else {
            Ok(String::new())
        };
        let primary_host = if of(SinkKind::Sparkplug) {
            table.name("primary_host").check(is_name).optional()
        } else {
            Ok(None)
        };
        table.finish();
        let (kind, host, tls) = (kind?, host?, tls?);
        let port = port?.and_then(|port| u16::try_from(port).ok()).unwrap_or(kind.port(tls));
        if !tls && !is_this_computer(&host) {
            let message = format!(
                "tls = false would send the password in the clear to {host}; only a sink on this computer may go without"
            );
            return Err(document.fault(&place, message));
        }
        let sink = Self {
            name: name?.unwrap_or_else(|| kind.name().to_owned()),
            kind,
            host,
            port,
            tls,
            ca_file: ca_file?,
            user: user?,
            password_file: password_file?,
            database: database?,
            primary_host: primary_host?,
        };
        Ok(Located { value: sink, place })
    }
}

/// Checks that names of sinks differ.
fn once(document: &Document, sinks: &[Located<SinkUse>]) -> Result<(), Reported> {
    for (k, sink) in sinks.iter().enumerate() {
        if sinks[..k].iter().any(|earlier| earlier.value.name == sink.value.name) {
            let message = format!("a second sink of the name {:?}; give each a name", sink.value.name);
            return Err(document.fault(&sink.place, message));
        }
    }
    Ok(())
}

/// Checks a name that is used in topics and roles: it must not contain a separator or wildcard of any of them.
fn is_name(name: &String) -> Result<(), String> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    match name.len() <= 40 && name.chars().all(allowed) {
        true => Ok(()),
        false => Err(format!("found {name:?}, allowed are up to 40 letters, digits, \"-\", \"_\" and \".\"")),
    }
}

fn is_this_computer(host: &str) -> bool {
    host == "localhost" || host.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback())
}
