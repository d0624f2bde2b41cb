//! Client of a simulated press: `platen-sim press` as a child process, with its control port.
//!
//! Each request to the control port is one JSON object on a line, and so is each answer: counts, registers, accepted
//! results.

use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value as Json;

use super::CliError;

/// Child process `platen-sim press`, ended with this program.
#[derive(Debug)]
pub struct Cell {
    child: Child,
    /// Address of the Modbus server; `None` on a serial line.
    pub modbus: Option<SocketAddr>,
    /// Address of the control port, from which the simulated scanner also reads the plate's shape.
    pub plate: SocketAddr,
    control: Option<BufReader<TcpStream>>,
}

/// Result as the press accepted it.
#[derive(Debug, Clone, Deserialize)]
pub struct AcceptedResult {
    /// Stroke number.
    pub stroke_id: u16,
    /// Session of the stroke.
    pub session_id: u16,
    attempt: u16,
    /// Time from the trigger to the host's echo, milliseconds, on the press's clock.
    pub accepted_ms: f64,
    /// Time from the trigger to the result, milliseconds.
    pub result_ms: f64,
    /// Words of the host's block.
    pub words: Vec<u16>,
}

impl AcceptedResult {
    /// Returns whether it is the result of this stroke.
    pub fn is(&self, stroke: u16, session: u16, attempt: u16) -> bool {
        (self.stroke_id, self.session_id, self.attempt) == (stroke, session, attempt)
    }
}

fn failed(what: &str) -> impl Fn(std::io::Error) -> CliError + '_ {
    move |error| CliError::Failed(format!("{what}: {error}"))
}

impl Cell {
    /// Starts `platen-sim` from the folder of this program; `options` override the file.
    ///
    /// # Errors
    /// The program is missing, or ends before it prints its ports.
    pub fn start(config: &Path, options: &[&str]) -> Result<Self, CliError> {
        let program =
            std::env::current_exe()?.with_file_name(format!("platen-sim{}", std::env::consts::EXE_SUFFIX));
        let what = format!(
            "{}: cannot be started (the package platen-sim has it, `cargo build --release` builds it)",
            program.display()
        );
        let mut child = Command::new(&program)
            .arg("press")
            .arg(config)
            .args(options)
            .args(["--plate-port", "0", "--with-parent"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(failed(&what))?;
        let mut line = String::new();
        if let Some(stdout) = child.stdout.take() {
            BufReader::new(stdout).read_line(&mut line).map_err(failed("platen-sim"))?;
        }
        let ports: Json = serde_json::from_str(&line).unwrap_or_default();
        let port = |name: &str| ports[name].as_str().and_then(|text| text.parse().ok());
        let unready = || CliError::Failed("platen-sim ended before it was ready; its error is above".into());
        let plate = port("plate").ok_or_else(unready)?;
        Ok(Self { child, modbus: port("modbus"), plate, control: None })
    }

    /// Sends a line to the control port and returns the answer.
    ///
    /// # Errors
    /// The control port does not answer with JSON.
    pub fn ask(&mut self, question: &str) -> Result<Json, CliError> {
        let control = match &mut self.control {
            Some(control) => control,
            None => {
                let stream = TcpStream::connect(self.plate).map_err(failed("simulated press"))?;
                stream.set_read_timeout(Some(Duration::from_secs(5))).map_err(failed("simulated press"))?;
                self.control.insert(BufReader::new(stream))
            }
        };
        let mut answer = String::new();
        writeln!(control.get_mut(), "{question}").map_err(failed("simulated press"))?;
        control.read_line(&mut answer).map_err(failed("simulated press"))?;
        serde_json::from_str(&answer).map_err(|e| CliError::Failed(format!("simulated press: {e}")))
    }

    /// Returns whether the press has made all its strokes or its plate has passed.
    pub fn is_done(&mut self) -> Result<bool, CliError> {
        Ok(self.ask(r#"{"get":"stats"}"#)?["stats"]["done"] == true)
    }

    /// Sends a line to the control port and reads the part of the answer at a JSON pointer.
    ///
    /// # Errors
    /// The control port does not answer, or its answer has no such part.
    pub fn read<T: DeserializeOwned>(&mut self, question: &str, pointer: &str) -> Result<T, CliError> {
        let part = self.ask(question)?.pointer_mut(pointer).map(Json::take).unwrap_or_default();
        serde_json::from_value(part).map_err(|e| CliError::Failed(format!("simulated press: {e}")))
    }

    /// Returns the host's block of registers.
    pub fn registers(&mut self) -> Result<Vec<u16>, CliError> {
        self.read(r#"{"get":"registers"}"#, "/registers/h")
    }

    /// Returns the results that the press accepted, in order.
    pub fn accepted_results(&mut self) -> Result<Vec<AcceptedResult>, CliError> {
        self.read(r#"{"get":"stats"}"#, "/stats/taken")
    }
}

impl Drop for Cell {
    fn drop(&mut self) {
        // Closing its input ends it; it may have ended already.
        drop(self.child.stdin.take());
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
