//! The link that the plant file asks for.

use platen_plant::press::{Press, Role, Transport};

use super::{Link, ModbusLink, Request, Response, ServedLink, TransportError};

/// A link to a press, whoever asks and whoever answers.
#[derive(Debug)]
pub enum PressLink {
    /// The host asks.
    Asking(ModbusLink),
    /// The press asks.
    Served(ServedLink),
}

impl PressLink {
    /// The link that the plant file describes; not connected yet. Only Modbus TCP can be served, which the plant file's
    /// check sees to.
    pub fn new(press: &Press) -> Self {
        match (press.role, &press.link.transport) {
            (Role::Server, Transport::Tcp(socket)) => Self::Served(ServedLink::new(press, socket)),
            (Role::Server | Role::Client, _) => Self::Asking(ModbusLink::new(&press.link)),
        }
    }
}

impl Link for PressLink {
    fn peer(&self) -> String {
        match self {
            Self::Asking(link) => link.peer(),
            Self::Served(link) => link.peer(),
        }
    }

    async fn connect(&mut self) -> Result<(), TransportError> {
        match self {
            Self::Asking(link) => link.connect().await,
            Self::Served(link) => link.connect().await,
        }
    }

    async fn call(&mut self, request: &Request) -> Result<Response, TransportError> {
        match self {
            Self::Asking(link) => link.call(request).await,
            Self::Served(link) => link.call(request).await,
        }
    }

    fn disconnect(&mut self) {
        match self {
            Self::Asking(link) => link.disconnect(),
            Self::Served(link) => link.disconnect(),
        }
    }
}
