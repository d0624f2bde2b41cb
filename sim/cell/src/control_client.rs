//! Client of the press's control port.

use crate::error::Error;
use platen_sim_plate::{PlateState, Reply, Request};
use platen_sim_press::registers::{control, h, p, status};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::time::Duration;

/// Time limit of an answer.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Connection to the control port.
#[derive(Debug)]
pub(crate) struct ControlClient {
    address: String,
    reader: BufReader<TcpStream>,
}

/// Stroke that the host has accepted and for whose scan it waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PendingStroke {
    pub(crate) session: u16,
    pub(crate) stroke: u16,
    pub(crate) attempt: u16,
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Registers {
    Registers { p: Vec<u16>, h: Vec<u16> },
}

impl ControlClient {
    /// Connects to the control port.
    pub(crate) fn open(address: &str) -> Result<Self, Error> {
        let failed =
            |error: std::io::Error| Error::Control { address: address.into(), what: error.to_string() };
        let stream = TcpStream::connect(address).map_err(failed)?;
        stream.set_read_timeout(Some(TIMEOUT)).and_then(|()| stream.set_nodelay(true)).map_err(failed)?;
        Ok(Self { address: address.into(), reader: BufReader::new(stream) })
    }

    /// Requests the plate; `None` while the press is empty or the plate moves.
    pub(crate) fn plate(&mut self) -> Result<Option<PlateState>, Error> {
        let request = serde_json::to_string(&Request::Plate).unwrap_or_default();
        match self.ask(&request)? {
            Reply::Plate(state) => Ok(state.map(|state| *state)),
            Reply::Error(_) => Ok(None),
        }
    }

    /// Returns the stroke for whose scan the host waits, if any and if the plate is at rest.
    pub(crate) fn pending(&mut self) -> Result<Option<PendingStroke>, Error> {
        let Registers::Registers { p: press, h: host } = self.ask(r#"{"get":"registers"}"#)?;
        let word = |block: &[u16], at: usize| block.get(at).copied().unwrap_or(0);
        let (stroke, host_status) = (word(&press, p::STROKE_ID), word(&host, h::STATUS));
        let waits = word(&press, p::CONTROL) & control::CLEAR_TO_SCAN != 0
            && host_status & (status::BUSY | status::SCAN_DONE) == status::BUSY
            && word(&host, h::ACK_STROKE_ID) == stroke;
        let (session, attempt) = (word(&press, p::SESSION_ID), word(&press, p::ATTEMPT));
        Ok(waits.then_some(PendingStroke { session, stroke, attempt }))
    }

    fn ask<T: DeserializeOwned>(&mut self, request: &str) -> Result<T, Error> {
        let mut line = String::new();
        let said =
            writeln!(self.reader.get_mut(), "{request}").and_then(|()| self.reader.read_line(&mut line));
        let failed = |what: String| Error::Control { address: self.address.clone(), what };
        match said {
            Ok(0) => Err(failed("the connection was closed; start the press again".into())),
            Ok(_) => {
                serde_json::from_str(&line).map_err(|error| failed(format!("`{}`: {error}", line.trim_end())))
            }
            Err(error) => Err(failed(error.to_string())),
        }
    }
}
