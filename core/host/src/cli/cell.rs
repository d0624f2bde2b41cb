//! The simulated press as a program of its own, and what it says over its second port.

use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value as Json;

use super::CliError;

/// `platen-sim press`, ended with this program.
#[derive(Debug)]
pub struct Cell {
    child: Child,
    /// Where the press serves Modbus; `None` on a serial line.
    pub modbus: Option<SocketAddr>,
    /// Where it says what the plate looks like.
    pub plate: SocketAddr,
    line: Option<BufReader<TcpStream>>,
}

/// One result as the press took it.
#[derive(Debug, Clone, Copy)]
pub struct Taken {
    stroke: u16,
    session: u16,
    attempt: u16,
    /// From trigger to the host's echo, milliseconds, on the press's clock.
    pub accepted_ms: f64,
    /// From trigger to the result.
    pub result_ms: f64,
}

impl Taken {
    /// Whether it is the result of this stroke.
    pub fn is(&self, stroke: u16, session: u16, attempt: u16) -> bool {
        (self.stroke, self.session, self.attempt) == (stroke, session, attempt)
    }
}

fn failed(what: &str) -> impl Fn(std::io::Error) -> CliError + '_ {
    move |error| CliError::Failed(format!("{what}: {error}"))
}

impl Cell {
    /// Starts the program that lies beside this one; `options` overrule the file.
    pub fn start(config: &Path, options: &[&str]) -> Result<Self, CliError> {
        let program =
            std::env::current_exe()?.with_file_name(format!("platen-sim{}", std::env::consts::EXE_SUFFIX));
        let what = format!("{}: cannot be started (`cargo build --release` makes it)", program.display());
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
        let unready =
            || CliError::Failed("platen-sim ended before it was ready; its reason stands above".into());
        let plate = port("plate").ok_or_else(unready)?;
        Ok(Self { child, modbus: port("modbus"), plate, line: None })
    }

    /// Sends a line to the control port and returns the answer.
    ///
    /// # Errors
    /// The control port does not answer with JSON.
    pub fn ask(&mut self, question: &str) -> Result<Json, CliError> {
        let line = match &mut self.line {
            Some(line) => line,
            None => {
                let stream = TcpStream::connect(self.plate).map_err(failed("simulated press"))?;
                stream.set_read_timeout(Some(Duration::from_secs(5))).map_err(failed("simulated press"))?;
                self.line.insert(BufReader::new(stream))
            }
        };
        let mut answer = String::new();
        writeln!(line.get_mut(), "{question}").map_err(failed("simulated press"))?;
        line.read_line(&mut answer).map_err(failed("simulated press"))?;
        serde_json::from_str(&answer).map_err(|e| CliError::Failed(format!("simulated press: {e}")))
    }

    /// The press has made its strokes, or its plate has passed.
    pub fn is_done(&mut self) -> Result<bool, CliError> {
        Ok(self.ask(r#"{"get":"stats"}"#)?["stats"]["done"] == true)
    }

    /// The words that the host has written.
    pub fn registers(&mut self) -> Result<Vec<u16>, CliError> {
        let answer = self.ask(r#"{"get":"registers"}"#)?;
        let words = answer["registers"]["h"].as_array().cloned().unwrap_or_default();
        Ok(words.iter().filter_map(|word| u16::try_from(word.as_u64()?).ok()).collect())
    }

    /// Results as the press took them, in order.
    pub fn taken(&mut self) -> Result<Vec<Taken>, CliError> {
        let answer = self.ask(r#"{"get":"stats"}"#)?;
        let all = answer["stats"]["taken"].as_array().cloned().unwrap_or_default();
        let word = |taken: &Json, name: &str| u16::try_from(taken[name].as_u64()?).ok();
        let one = |taken: &Json| {
            Some(Taken {
                stroke: word(taken, "stroke_id")?,
                session: word(taken, "session_id")?,
                attempt: word(taken, "attempt")?,
                accepted_ms: taken["accepted_ms"].as_f64()?,
                result_ms: taken["result_ms"].as_f64()?,
            })
        };
        Ok(all.iter().filter_map(one).collect())
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
