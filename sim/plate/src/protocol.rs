//! Messages by which the simulated press serves its plate: one line of JSON per request and per reply, over TCP.
//!
//! `{"get":"plate"}` is answered by `{"plate":{...}}`, by `{"plate":null}` while the press is empty, or by
//! `{"error":"..."}`.

use crate::PlateState;
use serde::{Deserialize, Serialize};

/// Request, one line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "get", rename_all = "snake_case")]
pub enum Request {
    /// State of the plate in the press.
    Plate,
}

/// Reply, one line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reply {
    /// State of the plate, `None` while the press is empty.
    Plate(Option<Box<PlateState>>),
    /// Reason why there is no state: the request is invalid, or the plate is moving.
    Error(String),
}
