//! Link in the role that the plant file specifies: client or server.

use platen_plant::press::{Press, Role, Transport};

use super::{Link, ModbusLink, Request, Response, ServerLink, TransportError};

/// Link to a press in either role.
#[derive(Debug)]
pub enum PressLink {
    /// The host is the Modbus client.
    Asking(ModbusLink),
    /// The press is the Modbus client.
    Served(ServerLink),
}

impl PressLink {
    /// Returns the link of the plant file, not connected yet. The server role exists for Modbus TCP only, as the check
    /// of the plant file ensures.
    pub fn new(press: &Press) -> Self {
        match (press.role, &press.link.transport) {
            (Role::Server, Transport::Tcp(socket)) => Self::Served(ServerLink::new(press, socket)),
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
