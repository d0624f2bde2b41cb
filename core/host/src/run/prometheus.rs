//! Metrics of a host in the Prometheus text format 0.0.4, for a textfile collector: the host opens no port.

use platen_forward::SinkStatus;
use platen_press::ROUND_TRIP_LIMITS_MS;

use super::StatusRecord;

impl StatusRecord {
    /// Returns the metrics as text.
    pub fn prometheus(&self, running: bool) -> String {
        let mut text = String::new();
        let label = format!("press=\"{}\"", self.press.replace('\\', "\\\\").replace('"', "\\\""));
        let mut one = |name: &str, kind: &str, help: &str, value: f64| {
            text += &format!(
                "# HELP platen_{name} {help}\n# TYPE platen_{name} {kind}\nplaten_{name}{{{label}}} {value}\n"
            );
        };
        for (name, help, on) in [
            ("up", "1 while the host runs", running),
            ("link_fault", "1 while something is wrong with the link", self.link_error.is_some()),
            ("error", "1 while error_code is not 0", self.error.is_some()),
            ("warning", "1 while warning_code is not 0", self.warning.is_some()),
            (
                "results_waiting",
                "results on record that the press has not got",
                self.result_waits_s.is_some(),
            ),
        ] {
            one(name, "gauge", help, f64::from(u8::from(on)));
        }
        if let Some(clock) = self.clock {
            let help = "1 while a time server disciplines the clock";
            one("clock_synchronised", "gauge", help, f64::from(u8::from(clock.synchronised)));
        }
        one("result_waits_seconds", "gauge", "how long it has waited", self.result_waits_s.unwrap_or(0.0));
        if let Some(free) = self.disk_free {
            one("disk_free_bytes", "gauge", "free where results are written", free as f64);
        }
        for (name, help, count) in [
            ("strokes_total", "strokes accepted, every attempt", self.strokes),
            ("measured_total", "results with a measurement", self.measured),
            ("not_measured_total", "results without a measurement", self.not_measured),
            ("missed_total", "strokes missed", self.missed),
            ("records_lost_total", "records and result folders that could not be written", self.records_lost),
            ("ack_timeouts_total", "results not acknowledged in time", self.ack_timeouts),
            ("torn_reads_total", "reads that found the press writing its block", self.torn_reads),
            ("rewrites_total", "reads that found the host's block changed", self.rewrites),
            ("requests_total", "Modbus requests sent", self.link.requests),
            ("writes_total", "Modbus write requests sent", self.link.writes),
            ("writes_refused_total", "writes not sent because not allowed", self.link.writes_refused),
            ("connections_total", "connections built", self.link.connections),
            ("poisoned_total", "connections dropped for an error", self.link.poisoned),
            ("timeouts_total", "requests without an answer in time", self.link.timeouts),
        ] {
            one(name, "counter", help, count as f64);
        }
        one("link_down_seconds_total", "counter", "time out of step with the press", self.link_down_s);
        for (name, [median, most]) in [
            ("trigger_to_busy", self.trigger_to_busy_ms),
            ("stroke_to_result", self.stroke_to_result_ms),
            ("result_to_ack", self.result_to_ack_ms),
            ("journal", self.journal_ms),
        ] {
            text += &format!("# TYPE platen_{name}_seconds gauge\n");
            for (quantile, ms) in [("0.5", median), ("0.99", most)] {
                if let Some(ms) = ms {
                    text += &format!(
                        "platen_{name}_seconds{{{label},quantile=\"{quantile}\"}} {}\n",
                        ms / 1000.0
                    );
                }
            }
        }
        for (name, help, value) in [
            (
                "connected",
                "1 while the sink is connected",
                (|it| f64::from(u8::from(it.connected))) as fn(&SinkStatus) -> f64,
            ),
            ("backlog", "changes of the record that the sink has not got", |it| it.backlog as f64),
            ("behind_seconds", "age of the oldest of them", |it| it.behind_s.unwrap_or(0.0)),
            ("conflicts", "changes that differ from what the sink has", |it| it.conflicts as f64),
            ("refused", "changes that the sink refused", |it| it.refused as f64),
        ] {
            let Some(forward) = &self.forward else { continue };
            text += &format!("# HELP platen_sink_{name} {help}\n# TYPE platen_sink_{name} gauge\n");
            for sink in &forward.sinks {
                text += &format!("platen_sink_{name}{{{label},sink=\"{}\"}} {}\n", sink.name, value(sink));
            }
        }
        text += "# TYPE platen_exceptions_total counter\n";
        for (code, count) in &self.link.exceptions {
            text += &format!("platen_exceptions_total{{{label},code=\"{code:02X}\"}} {count}\n");
        }
        text += "# TYPE platen_round_trips_total counter\n";
        let limits = ROUND_TRIP_LIMITS_MS.iter().map(u64::to_string).chain(["longer".into()]);
        for (limit, count) in limits.zip(&self.link.round_trips) {
            text += &format!("platen_round_trips_total{{{label},up_to_ms=\"{limit}\"}} {count}\n");
        }
        text
    }
}
