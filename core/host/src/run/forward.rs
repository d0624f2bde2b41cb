//! Monitoring of `platen forward`: the state of its sinks for the status, and two alarms.
//!
//! The forwarder is a process of its own, which keeps its state in a file of the output folder. An alarm is raised if a
//! sink is far behind or keeps the strokes of this press separate. A forwarder that does not run also counts as behind.

use std::path::PathBuf;
use std::sync::PoisonError;
use std::time::{Duration, Instant};

use platen_forward::SinkStatus;
use platen_model::Code;

use super::alarms::Alarms;
use super::forward_record::{ForwardRecord, ForwardState};

/// Time between two reads of the state.
const PERIOD: Duration = Duration::from_secs(1);
/// Longest accepted delay of a sink.
const BEHIND: Duration = Duration::from_secs(3600);

/// Reads the forwarder's state each second, for ever.
pub(super) async fn watch(folder: PathBuf, state: ForwardState, alarms: Alarms) {
    let mut since_alive = Instant::now();
    let mut raised = Raised::default();
    loop {
        let record = ForwardRecord::load(&folder);
        if record.running {
            since_alive = Instant::now();
        }
        for (code, detail) in raised.next(&record, since_alive.elapsed()) {
            alarms.raise(code, None, Some(&detail));
        }
        *state.lock().unwrap_or_else(PoisonError::into_inner) = Some(record);
        tokio::time::sleep(PERIOD).await;
    }
}

/// Active alarms: each is raised once, and again after it has ended.
#[derive(Debug, Default)]
struct Raised {
    behind: bool,
    apart: bool,
}

impl Raised {
    /// Returns the alarms that become active with this state.
    fn next(&mut self, record: &ForwardRecord, silent: Duration) -> Vec<(Code, String)> {
        let late = |sink: &&SinkStatus| sink.behind_s.is_some_and(|s| s > BEHIND.as_secs_f64());
        let behind = match record.sinks.iter().find(late) {
            Some(sink) => Some(format!("{}: {}", sink.name, sink.line())),
            None => (silent > BEHIND).then(|| "platen forward does not run".to_owned()),
        };
        let apart =
            record.sinks.iter().find_map(|sink| Some(format!("{}: {}", sink.name, sink.apart.as_ref()?)));
        let mut alarms = Vec::new();
        for (stands, now, code) in
            [(&mut self.behind, behind, Code::SinkBehind), (&mut self.apart, apart, Code::SinkApart)]
        {
            let before = std::mem::replace(stands, now.is_some());
            alarms.extend(now.filter(|_| !before).map(|detail| (code, detail)));
        }
        alarms
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sink(behind_s: Option<f64>, apart: Option<&str>) -> ForwardRecord {
        let sink = serde_json::json!({
            "name": "historian", "kind": "postgresql", "connected": true, "error": null, "backlog": 0, "behind_s": behind_s, "sent": 0,
            "conflicts": 0, "refused": 0, "apart": apart,
        });
        ForwardRecord { running: true, sinks: vec![serde_json::from_value(sink).unwrap()] }
    }

    #[test]
    fn an_hour_behind_is_an_alarm_once_and_again_after_it_has_gone() {
        let mut raised = Raised::default();
        let codes = |raised: &mut Raised, record: &ForwardRecord, silent: u64| {
            raised
                .next(record, Duration::from_secs(silent))
                .into_iter()
                .map(|(code, _)| code)
                .collect::<Vec<_>>()
        };
        assert_eq!(codes(&mut raised, &sink(Some(3599.0), None), 0), []);
        assert_eq!(codes(&mut raised, &sink(Some(3601.0), None), 0), [Code::SinkBehind]);
        assert_eq!(codes(&mut raised, &sink(Some(3602.0), None), 0), []);
        assert_eq!(codes(&mut raised, &sink(None, Some("taken")), 0), [Code::SinkApart]);
        assert_eq!(
            codes(&mut raised, &sink(None, Some("taken")), 3601),
            [Code::SinkBehind],
            "nobody forwards"
        );
    }
}
