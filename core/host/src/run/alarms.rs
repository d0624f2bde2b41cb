//! Dispatch of alarms: to the log, the record, `platen status` and the pages.

use std::sync::{Arc, Mutex, PoisonError};

use jiff::Timestamp;
use platen_history::History;
use platen_model::{Code, Language, StrokeKey};

use super::screen::{Event, EventSender};
use super::status::NewestAlarm;

/// Passes alarms on. Alarms of the press side are already in its registers.
#[derive(Clone)]
pub(super) struct Alarms {
    pub(super) history: Arc<Mutex<History>>,
    pub(super) newest: NewestAlarm,
    pub(super) screen: EventSender,
}

impl Alarms {
    /// Raises an alarm, with or without a stroke.
    pub(super) fn raise(&self, code: Code, stroke: Option<StrokeKey>, detail: Option<&str>) {
        self.screen.send(Event::Alarm(code));
        let alarm = code.alarm();
        let stroke = stroke.map(|key| format!("{key}: ")).unwrap_or_default();
        let detail = detail.map(|detail| format!(" ({detail})")).unwrap_or_default();
        let text = format!("{stroke}{}{detail}; {}", alarm.text(Language::En), alarm.remedy(Language::En));
        tracing::warn!(code = code.number(), "{text}");
        let now = Timestamp::now();
        let numbered = format!("{} {text}", code.number());
        let mut history = self.history.lock().unwrap_or_else(PoisonError::into_inner);
        if let Err(error) = history.note("alarm", None, &numbered, now) {
            tracing::warn!("the alarm is not on record: {error}");
        }
        drop(history);
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some((now, numbered));
    }
}
