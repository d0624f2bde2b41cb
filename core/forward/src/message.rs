//! Messages `platen.stroke/1`: a change of the record as delivered to consumers, the same bytes each time it is sent.
//!
//! A change is identified by site, press, owner number, kind and id ([`Key`]). Its message contains only data that
//! cannot change after the change was made, so that a change that is sent again has the same SHA-256. Lengths in
//! documents are in millimetres, named `_mm`; figures are those of the record, in metres, radians, seconds and
//! fractions.

mod document;

use std::collections::BTreeMap;

use platen_history::{Archive, Change, ChangeKind, Error, PlateRecord, Stroke};
use platen_model::{StrokeKey, Verdict};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value as Json;
use sha2::{Digest as _, Sha256};

pub use document::DocumentExcerpt;

/// Version of the messages.
pub const SCHEMA: &str = "platen.stroke/1";

/// Names under which a record is sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Names {
    /// Site.
    pub site: String,
    /// Press, unique at its site.
    pub press: String,
    /// True when the codes of crews are sent.
    pub crews: bool,
}

/// A change ready to be sent.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// Number of the change in the record: the cursor after it was sent.
    pub n: u64,
    /// Identity within its press.
    pub key: Key,
    /// Time of the change, RFC 3339.
    pub at: String,
    /// The document, JSON.
    pub text: String,
    /// Its SHA-256, hexadecimal.
    pub sha256: String,
}

/// Identity of a change within its press. A consumer drops what it has by site, press and this.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Key {
    /// Owner number of the record when the change was made; a restored record gets another one.
    pub owner: u16,
    /// Kind: `accepted`, `finished`, `acked`, `plate` or `event`.
    pub kind: String,
    /// Run id of the stroke; number of the event; of a plate's end, number of the change.
    pub id: u64,
}

/// Content of a message.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(title = "platen.stroke/1")]
pub struct Document<'a> {
    /// `platen.stroke/1`.
    pub schema: &'a str,
    /// Site.
    pub site: &'a str,
    /// Press, unique at its site.
    pub press: &'a str,
    /// Identity of the change.
    #[serde(flatten)]
    pub key: &'a Key,
    /// Time of the change, UTC.
    pub at: &'a str,
    /// The plate; absent of an event.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plate: Option<PlateOf<'a>>,
    /// The stroke; absent of a plate's end and an event.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stroke: Option<StrokeOf<'a>>,
    /// The result; of kind `finished`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub result: Option<ResultOf<'a>>,
    /// The acknowledgement; of kind `acked`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acknowledgement: Option<Acknowledgement<'a>>,
    /// The event; of kind `event`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub event: Option<EventOf<'a>>,
}

/// Physical plate.
#[derive(Debug, Serialize, JsonSchema)]
pub struct PlateOf<'a> {
    /// Number in the record.
    pub number: u32,
    /// The press's part number.
    pub part_id: Option<u32>,
    /// The press's part name.
    pub part_name: Option<&'a str>,
    /// Acceptance of its first stroke, UTC.
    pub began: String,
}

/// Stroke at its acceptance.
#[derive(Debug, Serialize, JsonSchema)]
pub struct StrokeOf<'a> {
    /// The press's own key: press number, session, stroke, attempt.
    #[schemars(with = "BTreeMap<String, u16>")]
    pub key: StrokeKey,
    /// Recipe number of the plate file.
    pub recipe: Option<u16>,
    /// A scan of the blank.
    pub baseline: bool,
    /// A trial.
    pub dry_run: bool,
    /// Time of acceptance, UTC.
    pub accepted: String,
    /// Data of the press, in metres, newtons, radians and degrees Celsius.
    pub press_data: &'a Json,
}

/// Result of a stroke.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ResultOf<'a> {
    /// Time of the scan, UTC.
    pub scanned: Option<String>,
    /// Time of the result, UTC.
    pub finished: Option<String>,
    /// Verdict: `pass`, `fail`, `cannot_tell` or `not_measured`.
    #[schemars(with = "Option<String>")]
    pub verdict: Option<Verdict>,
    /// Reason of a missing measurement.
    pub reason: Option<&'a str>,
    /// Named figures, in metres, radians, seconds and fractions.
    pub figures: &'a BTreeMap<String, f64>,
    /// Parts of the result document; null where there is none, or it was lost.
    pub document: Option<DocumentExcerpt>,
}

/// Acknowledgement of a result by the press, or giving up on it.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Acknowledgement<'a> {
    /// Its time, UTC.
    pub acked: String,
    /// Its name.
    pub how: Option<&'a str>,
}

/// Event beside the strokes.
#[derive(Debug, Serialize, JsonSchema)]
pub struct EventOf<'a> {
    /// Kind: `alarm`, `clock`.
    pub kind: &'a str,
    /// Run id of the stroke it belongs to.
    pub run_id: Option<u32>,
    /// Sentence for people.
    pub text: &'a str,
}

/// Returns the message of a change; `None` for a kind that a later version added.
///
/// # Errors
/// [`Error`] when the record cannot be read.
pub fn message(archive: &Archive, names: &Names, change: &Change) -> Result<Option<Message>, Error> {
    let Some(kind) = change.kind.name() else { return Ok(None) };
    let key = |id: u64| Key { owner: change.owner, kind: kind.to_owned(), id };
    let sealed = |key: Key, parts: Document<'_>| seal(change, names, key, parts);
    match (change.kind, change.run_id, change.event) {
        (ChangeKind::Accepted | ChangeKind::Finished | ChangeKind::Acked, Some(run_id), _) => {
            let stroke = archive.stroke(run_id)?;
            let plate = archive.plate(stroke.plate)?;
            let data = press_data(&stroke, names);
            let mut parts = Document {
                plate: plate.as_ref().map(plate_of),
                stroke: Some(stroke_of(&stroke, &data)),
                ..empty()
            };
            match change.kind {
                ChangeKind::Finished => parts.result = Some(result_of(&stroke)),
                ChangeKind::Acked => {
                    let acked = stroke.acked.map(time).unwrap_or_default();
                    parts.acknowledgement = Some(Acknowledgement { acked, how: stroke.ack.as_deref() });
                }
                _ => {}
            }
            Ok(Some(sealed(key(run_id.into()), parts)))
        }
        (ChangeKind::Plate, _, _) => {
            let plate = change.plate.map(|plate| archive.plate(plate)).transpose()?.flatten();
            Ok(Some(sealed(key(change.n), Document { plate: plate.as_ref().map(plate_of), ..empty() })))
        }
        (ChangeKind::Event, run_id, Some(event)) => {
            let Some(event) = archive.events(event.saturating_sub(1), 1)?.pop() else { return Ok(None) };
            let of = EventOf { kind: &event.kind, run_id, text: &event.text };
            Ok(Some(sealed(key(event.event.into()), Document { event: Some(of), ..empty() })))
        }
        _ => Ok(None),
    }
}

fn empty<'a>() -> Document<'a> {
    const KEY: &Key = &Key { owner: 0, kind: String::new(), id: 0 };
    Document {
        schema: SCHEMA,
        site: "",
        press: "",
        key: KEY,
        at: "",
        plate: None,
        stroke: None,
        result: None,
        acknowledgement: None,
        event: None,
    }
}

fn seal(change: &Change, names: &Names, key: Key, parts: Document<'_>) -> Message {
    let document = Document { site: &names.site, press: &names.press, key: &key, at: &change.at, ..parts };
    // All data of a record can be written as JSON; databases refuse text with the character 0.
    let text = serde_json::to_string(&document).unwrap_or_default().replace("\\u0000", "\\ufffd");
    let sha256 = sha256(text.as_bytes());
    Message { n: change.n, at: change.at.clone(), text, sha256, key }
}

fn plate_of(plate: &PlateRecord) -> PlateOf<'_> {
    PlateOf {
        number: plate.plate,
        part_id: plate.part_id,
        part_name: plate.part_name.as_deref(),
        began: time(plate.began),
    }
}

fn stroke_of<'a>(stroke: &Stroke, press_data: &'a Json) -> StrokeOf<'a> {
    StrokeOf {
        key: stroke.key,
        recipe: stroke.recipe,
        baseline: stroke.baseline,
        dry_run: stroke.dry_run,
        accepted: time(stroke.accepted),
        press_data,
    }
}

fn result_of(stroke: &Stroke) -> ResultOf<'_> {
    ResultOf {
        scanned: stroke.scanned.map(time),
        finished: stroke.finished.map(time),
        verdict: stroke.verdict,
        reason: stroke.reason.as_deref(),
        figures: &stroke.figures,
        document: stroke.document.as_deref().and_then(DocumentExcerpt::load),
    }
}

/// Returns the data of the press, without the code of the crew unless it may leave the record.
fn press_data(stroke: &Stroke, names: &Names) -> Json {
    let mut data: Json = serde_json::from_str(&stroke.data).unwrap_or_default();
    if let Some(values) = data.as_object_mut().filter(|_| !names.crews) {
        values.remove("crew");
    }
    data
}

/// Returns the SHA-256 of bytes, hexadecimal.
fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn time(at: jiff::Timestamp) -> String {
    format!("{at:.3}")
}

/// Returns the JSON schema of the messages.
#[must_use]
pub fn schema() -> Json {
    schemars::schema_for!(Document<'static>).into()
}
