//! Modbus TCP server of the simulated PLC.

use std::future::{Ready, ready};

use tokio::net::TcpListener;
use tokio_modbus::server::tcp::{Server, accept_tcp_connection};
use tokio_modbus::{ExceptionCode, Request, Response, SlaveRequest};

use super::SharedPlc;

#[derive(Clone)]
struct Service(SharedPlc);

impl tokio_modbus::server::Service for Service {
    type Request = SlaveRequest<'static>;
    type Response = Option<Response>;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Option<Response>, ExceptionCode>>;

    fn call(&self, request: SlaveRequest<'static>) -> Self::Future {
        let mut plc = self.0.lock().unwrap();
        ready(match request.request {
            Request::ReadHoldingRegisters(start, count) => {
                let words = plc.read(start, count).map(|words| Some(Response::ReadHoldingRegisters(words)));
                words.ok_or(ExceptionCode::IllegalDataAddress)
            }
            Request::WriteMultipleRegisters(start, words) => {
                let done = plc.write(start, &words);
                let response = Response::WriteMultipleRegisters(start, words.len() as u16);
                if done { Ok(Some(response)) } else { Err(ExceptionCode::IllegalDataAddress) }
            }
            _ => Err(ExceptionCode::IllegalFunction),
        })
    }
}

/// Serves the PLC on a free port; returns the port.
pub(crate) async fn serve(plc: SharedPlc) -> u16 {
    let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
    let port = listener.local_addr().unwrap().port();
    tokio::spawn(async move {
        let on_connected = |stream, address| {
            let plc = SharedPlc::clone(&plc);
            async move { accept_tcp_connection(stream, address, move |_| Ok(Some(Service(plc.clone())))) }
        };
        let _ = Server::new(listener).serve(&on_connected, |_| {}).await;
    });
    port
}
