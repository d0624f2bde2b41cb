//! What the simulated press answers about its plate: one line of JSON per request, one per reply, over TCP.
//!
//! `{"get":"plate"}` is answered by `{"plate":{...}}`, by `{"plate":null}` while no plate lies in the press, or
//! by `{"error":"..."}`.

use crate::PlateState;
use serde::{Deserialize, Serialize};

/// A question, one line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "get", rename_all = "snake_case")]
pub enum Request {
    /// The plate as it lies in the press now.
    Plate,
}

/// The answer, one line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reply {
    /// The plate, `None` while there is none.
    Plate(Option<Box<PlateState>>),
    /// The question was not understood, or the plate is moving; says which.
    Error(String),
}
