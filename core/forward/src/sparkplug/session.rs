//! Session of an edge node: sequence numbers, births and received requests, as a state machine without a connection.
//!
//! Transitions are named by the identifiers of the Sparkplug 3.0 specification (`tck-id-...`).

use jiff::Timestamp;
use serde::Deserialize;
use srad_types::constants::NODE_CONTROL_REBIRTH;
use srad_types::payload::{Message as _, Payload, metric::Value};

use crate::message::Names;

/// Session from one connection to its end.
#[derive(Debug)]
pub(super) struct Session {
    command_topic: String,
    state_topic: Option<String>,
    bd_seq: u8,
    next: u8,
    born: Option<Timestamp>,
    /// Time of the newest state of the primary host application, milliseconds.
    primary_at: u64,
}

/// Request in a received message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Heard {
    /// No request.
    Nothing,
    /// Request for all births again.
    Rebirth,
    /// The primary host application is online.
    PrimaryOnline,
    /// The primary host application is offline.
    PrimaryOffline,
}

/// Payload of STATE: `tck-id-host-topic-phid-birth-payload`.
#[derive(Deserialize)]
struct State {
    online: bool,
    timestamp: u64,
}

impl Session {
    pub(super) fn new(names: &Names, primary_host: Option<&str>, bd_seq: u8) -> Self {
        Self {
            command_topic: format!("spBv1.0/{}/NCMD/{}", names.site, names.press),
            state_topic: primary_host.map(|host| format!("spBv1.0/STATE/{host}")),
            bd_seq,
            next: 0,
            born: None,
            primary_at: 0,
        }
    }

    /// Returns the number that pairs birth and death: `tck-id-payloads-ndeath-bdseq`.
    pub(super) fn bd_seq(&self) -> u8 {
        self.bd_seq
    }

    pub(super) fn is_born(&self) -> bool {
        self.born.is_some()
    }

    /// Records the birth; returns the sequence numbers of NBIRTH and DBIRTH. `tck-id-payloads-nbirth-seq`: the first is
    /// 0.
    pub(super) fn born(&mut self, now: Timestamp) -> [u8; 2] {
        self.next = 0;
        // A rebirth does not start a new session: strokes that were live remain live.
        self.born = self.born.or(Some(now));
        [self.next_seq(), self.next_seq()]
    }

    /// Returns the next sequence number, 0 after 255: `tck-id-payloads-sequence-num-incrementing`.
    pub(super) fn next_seq(&mut self) -> u8 {
        let seq = self.next;
        self.next = seq.wrapping_add(1);
        seq
    }

    /// Returns whether a time lies before the birth, so that its data is historical.
    pub(super) fn is_historical(&self, at: &str) -> bool {
        match (self.born, at.parse::<Timestamp>()) {
            (Some(born), Ok(at)) => at < born,
            _ => true,
        }
    }

    pub(super) fn hear(&mut self, topic: &str, payload: &[u8]) -> Heard {
        if topic == self.command_topic && self.is_born() && asks_for_rebirth(payload) {
            // tck-id-operational-behavior-data-commands-rebirth-action-1 to 3.
            return Heard::Rebirth;
        }
        if self.state_topic.as_deref() != Some(topic) {
            return Heard::Nothing;
        }
        let Ok(state) = serde_json::from_slice::<State>(payload) else { return Heard::Nothing };
        if state.timestamp < self.primary_at {
            // tck-id-message-flow-edge-node-birth-publish-phid-wait-timestamp: an older state is ignored.
            return Heard::Nothing;
        }
        self.primary_at = state.timestamp;
        match (state.online, self.is_born()) {
            (true, _) => Heard::PrimaryOnline,
            (false, true) => Heard::PrimaryOffline,
            (false, false) => Heard::Nothing,
        }
    }
}

fn asks_for_rebirth(payload: &[u8]) -> bool {
    let Ok(command) = Payload::decode(payload) else { return false };
    command.metrics.iter().any(|metric| {
        metric.name.as_deref() == Some(NODE_CONTROL_REBIRTH)
            && metric.value == Some(Value::BooleanValue(true))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session(primary: Option<&str>) -> Session {
        let names = Names { site: "kure".into(), press: "press-3".into(), crews: false };
        Session::new(&names, primary, 7)
    }

    fn state(online: bool, at: u64) -> Vec<u8> {
        format!("{{\"online\":{online},\"timestamp\":{at}}}").into_bytes()
    }

    #[test]
    fn numbers_begin_at_0_with_each_birth_and_wrap() {
        let mut session = session(None);
        let now = Timestamp::now();
        assert_eq!(session.born(now), [0, 1]);
        assert_eq!((2..=255).map(|_| session.next_seq()).last(), Some(255));
        assert_eq!(session.next_seq(), 0);
        assert_eq!(session.born(now), [0, 1]);
        assert_eq!(session.bd_seq(), 7, "a rebirth keeps its number");
    }

    #[test]
    fn what_came_before_the_birth_is_history_also_after_a_rebirth() {
        let mut session = session(None);
        let born: Timestamp = "2026-11-24T10:00:00Z".parse().unwrap();
        assert!(session.is_historical("2026-11-24T10:00:01Z"), "not born");
        session.born(born);
        session.born("2026-11-24T11:00:00Z".parse().unwrap());
        assert!(session.is_historical("2026-11-24T09:59:59.999Z"));
        assert!(!session.is_historical("2026-11-24T10:00:01Z"));
    }

    #[test]
    fn the_newest_state_of_the_primary_host_decides() {
        let mut session = session(Some("scada"));
        let topic = "spBv1.0/STATE/scada";
        assert_eq!(session.hear(topic, &state(false, 10)), Heard::Nothing, "it waits");
        assert_eq!(session.hear(topic, &state(true, 9)), Heard::Nothing, "older than what is known");
        assert_eq!(session.hear("spBv1.0/STATE/other", &state(true, 20)), Heard::Nothing);
        assert_eq!(session.hear(topic, &state(true, 11)), Heard::PrimaryOnline);
        session.born(Timestamp::now());
        assert_eq!(session.hear(topic, &state(false, 10)), Heard::Nothing, "the will of an earlier session");
        assert_eq!(session.hear(topic, &state(false, 12)), Heard::PrimaryOffline);
        assert_eq!(session.hear(topic, b"OFFLINE"), Heard::Nothing);
    }

    #[test]
    fn a_command_for_this_node_alone_asks_for_a_rebirth() {
        let mut session = session(None);
        let mut metric = srad_types::payload::Metric::new();
        metric.set_name(NODE_CONTROL_REBIRTH.into()).set_value(Value::BooleanValue(true));
        let bytes: Vec<u8> =
            Payload { timestamp: Some(1), metrics: vec![metric], ..Payload::default() }.into();
        assert_eq!(session.hear("spBv1.0/kure/NCMD/press-3", &bytes), Heard::Nothing, "not born");
        session.born(Timestamp::now());
        assert_eq!(session.hear("spBv1.0/kure/NCMD/press-3", &bytes), Heard::Rebirth);
        assert_eq!(session.hear("spBv1.0/kure/NCMD/press-4", &bytes), Heard::Nothing);
        assert_eq!(session.hear("spBv1.0/kure/NCMD/press-3", &[0xff, 0xff]), Heard::Nothing);
    }
}
