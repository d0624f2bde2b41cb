//! Modbus client on tokio-modbus; each connection is owned by a task of its own.

use platen_plant::press::{self, Quiet, RegisterTable, Transport};
use tokio::sync::{mpsc, oneshot};
use tokio::task::AbortHandle;
use tokio_modbus::client::{self, Client as _, Context};
use tokio_modbus::prelude::ReadCode;
use tokio_modbus::{ExceptionCode, Slave};

use super::rtu::EchoFree;
use super::{Link, Request, Response, TransportError, rtu, tcp};

type Call = (Request, oneshot::Sender<Result<Response, TransportError>>);

/// A link to a press that answers Modbus requests.
#[derive(Debug)]
pub struct ModbusLink {
    transport: Transport,
    unit: Slave,
    connection: Option<Connection>,
}

/// A connection, owned by a task of its own: a panic in the protocol library ends the task and not the handshake, and
/// late answers end with the task.
#[derive(Debug)]
struct Connection {
    calls: mpsc::Sender<Call>,
    task: AbortHandle,
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.task.abort();
    }
}

impl ModbusLink {
    /// Returns the link of the plant file, not connected yet.
    pub fn new(link: &press::Link) -> Self {
        Self { transport: link.transport.clone(), unit: Slave(link.unit), connection: None }
    }
}

impl Link for ModbusLink {
    fn peer(&self) -> String {
        format!("{} unit {}", self.transport, self.unit.0)
    }

    async fn connect(&mut self) -> Result<(), TransportError> {
        let context = match &self.transport {
            Transport::Tcp(socket) => client::tcp::attach_slave(tcp::connect(socket).await?, self.unit),
            Transport::Rtu(serial, Quiet(quiet)) => {
                let mut port = rtu::open(serial)?;
                rtu::drain(&mut port, *quiet).await?;
                if serial.echo {
                    client::rtu::attach_slave(EchoFree::new(port), self.unit)
                } else {
                    client::rtu::attach_slave(port, self.unit)
                }
            }
            Transport::RtuOverTcp(socket, Quiet(quiet)) => {
                let mut stream = tcp::connect(socket).await?;
                rtu::drain(&mut stream, *quiet).await?;
                client::rtu::attach_slave(stream, self.unit)
            }
        };
        let (calls, queue) = mpsc::channel(1);
        let task = tokio::spawn(own(context, queue)).abort_handle();
        self.connection = Some(Connection { calls, task });
        Ok(())
    }

    async fn call(&mut self, request: &Request) -> Result<Response, TransportError> {
        let connection = self.connection.as_ref().ok_or(TransportError::NotConnected)?;
        let (reply, answer) = oneshot::channel();
        connection.calls.send((request.clone(), reply)).await.map_err(|_| TransportError::Abandoned)?;
        answer.await.map_err(|_| TransportError::Abandoned)?
    }

    fn disconnect(&mut self) {
        self.connection = None;
    }
}

/// Executes calls until the first failure.
async fn own(mut context: Context, mut calls: mpsc::Receiver<Call>) {
    while let Some((request, reply)) = calls.recv().await {
        let answer = call(&mut context, request).await;
        let failed = answer.is_err();
        if reply.send(answer).is_err() || failed {
            return;
        }
    }
}

/// Executes one request. The library's read and write helpers check quantity and echo by debug assertions only and are
/// not used; [`Client`](super::Client) checks.
async fn call(context: &mut Context, request: Request) -> Result<Response, TransportError> {
    use tokio_modbus::{Request as Wire, Response as WireResponse};
    let wire = match request {
        Request::Read { table: RegisterTable::Holding, start, count } => {
            Wire::ReadHoldingRegisters(start, count)
        }
        Request::Read { table: RegisterTable::Input, start, count } => Wire::ReadInputRegisters(start, count),
        Request::Write { start, words } => Wire::WriteMultipleRegisters(start, words.into()),
        Request::Identify => Wire::ReadDeviceIdentification(ReadCode::Basic, 0),
    };
    match context.call(wire).await {
        Ok(Ok(WireResponse::ReadHoldingRegisters(words) | WireResponse::ReadInputRegisters(words))) => {
            Ok(Response::Words(words))
        }
        Ok(Ok(WireResponse::WriteMultipleRegisters(start, count))) => Ok(Response::Written { start, count }),
        Ok(Ok(WireResponse::ReadDeviceIdentification(identity))) => {
            let texts = identity.device_id_objects.iter().filter_map(|object| object.value_as_str());
            Ok(Response::Identity(texts.map(str::to_owned).collect()))
        }
        Ok(Ok(other)) => {
            Err(TransportError::Protocol(format!("an answer that was not asked for: {other:?}")))
        }
        Ok(Err(exception)) => Ok(Response::Exception(exception_code(exception))),
        Err(tokio_modbus::Error::Transport(source)) => Err(TransportError::Io(source)),
        Err(tokio_modbus::Error::Protocol(source)) => Err(TransportError::Protocol(source.to_string())),
    }
}

fn exception_code(exception: ExceptionCode) -> u8 {
    exception.into()
}
