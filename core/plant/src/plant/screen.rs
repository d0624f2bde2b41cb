//! Table `[screen]`: address of the browser pages, and access to them.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use crate::TomlTable;
use crate::document::Reported;

/// Default address: this computer alone.
const LISTEN: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 8380);

/// Browser pages of a running host. Without the table no port is opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Screen {
    /// Address and port.
    pub listen: SocketAddr,
    /// File with the token that a browser must give; required for any address but loopback.
    pub token_file: Option<PathBuf>,
    /// Further host names in the address bar of browsers: `press3.plant.example`.
    pub names: Vec<String>,
}

impl Screen {
    /// Returns pages on an address, without a token.
    pub fn on(listen: SocketAddr) -> Self {
        Self { listen, token_file: None, names: Vec::new() }
    }

    pub(super) fn read(mut table: TomlTable<'_>, folder: &Path) -> Result<Self, Reported> {
        let document = table.document();
        let listen = table.string("listen").try_map(|text| {
            text.parse::<SocketAddr>().map_err(|_| {
                format!("found {text:?}, expected an address and a port like \"127.0.0.1:8380\" or \"0.0.0.0:8380\"")
            })
        });
        let listen = listen.located().optional();
        let token_file = table.name("token_file").map(|file| folder.join(file)).optional();
        let names = table.strings("names").optional();
        table.finish();
        let (listen, token_file, names) = (listen?, token_file?, names?.unwrap_or_default());
        if let Some(listen) = &listen
            && token_file.is_none()
            && !listen.value.ip().is_loopback()
        {
            return Err(document.fault(
                &listen.place,
                "other computers could read the pages; make a token with `platen screen token FILE` and name it as token_file, \
                 or listen on 127.0.0.1",
            ));
        }
        let names = names.into_iter().map(|name| name.value).collect();
        Ok(Self { token_file, names, ..Self::on(listen.map_or(LISTEN, |listen| listen.value)) })
    }
}
