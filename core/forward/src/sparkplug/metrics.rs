//! Metrics of node and device, with their units in the births.

use serde_json::Value as Json;
use srad_types::constants::{BDSEQ, NODE_CONTROL_REBIRTH};
use srad_types::payload::metric::Value;
use srad_types::payload::{DataType, Metric, Payload, PropertySet, PropertyValue, property_value};

use crate::message::Message;
use crate::press_state::PressState;

/// Metric of the device: name, unit, type, place in a message of kind `finished`, and factor of its unit.
struct Measure {
    name: &'static str,
    unit: Option<&'static str>,
    kind: DataType,
    place: &'static str,
    factor: f64,
}

const fn text(name: &'static str, place: &'static str) -> Measure {
    Measure { name, unit: None, kind: DataType::String, place, factor: 1.0 }
}

const fn number(name: &'static str, unit: Option<&'static str>, place: &'static str, factor: f64) -> Measure {
    Measure { name, unit, kind: DataType::Double, place, factor }
}

const fn count(name: &'static str, place: &'static str) -> Measure {
    Measure { name, unit: None, kind: DataType::Int64, place, factor: 1.0 }
}

const MEASURES: [Measure; 14] = [
    count("Stroke/Run", "/id"),
    count("Stroke/Number", "/stroke/key/stroke"),
    count("Stroke/Attempt", "/stroke/key/attempt"),
    count("Plate/Number", "/plate/number"),
    text("Plate/Part", "/plate/part_name"),
    count("Plate/Recipe", "/stroke/recipe"),
    text("Result/Verdict", "/result/verdict"),
    text("Result/Says", "/result/document/says/0"),
    number("Result/Gap", Some("mm"), "/result/figures/gap.max", 1000.0),
    number("Result/Gap Uncertainty", Some("mm"), "/result/figures/gap.uncertainty", 1000.0),
    number("Result/Sense", None, "/result/figures/sense", 1.0),
    number("Result/Deviation RMS", Some("mm"), "/result/figures/deviation.rms", 1000.0),
    number("Result/Coverage", None, "/result/figures/coverage", 1.0),
    number("Result/Stroke To Result", Some("s"), "/result/figures/stroke_to_result_time", 1.0),
];

/// Returns NDEATH: the number of its birth only. `tck-id-payloads-ndeath-seq`: no sequence number.
pub(super) fn death(bd_seq: u8) -> Payload {
    Payload { timestamp: Some(now()), metrics: vec![bd_seq_metric(bd_seq)], ..Payload::default() }
}

/// Returns NBIRTH: every metric of the node.
pub(super) fn node_birth(state: &PressState, bd_seq: u8, seq: u8) -> Payload {
    let mut rebirth = metric(NODE_CONTROL_REBIRTH, DataType::Boolean, now());
    rebirth.set_value(Value::BooleanValue(false));
    let mut alarm = metric("Alarm", DataType::String, now());
    alarm.set_null();
    let mut metrics = vec![bd_seq_metric(bd_seq), rebirth, alarm];
    metrics.extend(state_metrics(state));
    payload(metrics, seq)
}

/// Returns NDATA with the state of the press.
pub(super) fn node_data(state: &PressState, seq: u8) -> Payload {
    payload(state_metrics(state).to_vec(), seq)
}

/// Returns NDATA with an alarm.
pub(super) fn alarm(message: &Message, historical: bool, seq: u8) -> Payload {
    let document = document(message);
    let mut alarm = metric("Alarm", DataType::String, millis(&message.at));
    set(&mut alarm, document.pointer("/event/text"), 1.0);
    alarm.is_historical = historical.then_some(true);
    payload(vec![alarm], seq)
}

/// Returns DBIRTH: every metric of the device, with the last stroke's values; null where there is none.
pub(super) fn device_birth(last: Option<&Message>, seq: u8) -> Payload {
    let document = last.map(document).unwrap_or_default();
    let at = last.map_or_else(now, |it| millis(&it.at));
    let metrics = MEASURES.iter().map(|measure| {
        let mut metric = measured(measure, &document, at);
        metric.properties = measure.unit.map(unit);
        metric
    });
    payload(metrics.collect(), seq)
}

/// Returns DDATA with a stroke.
pub(super) fn device_data(message: &Message, historical: bool, seq: u8) -> Payload {
    let (document, at) = (document(message), millis(&message.at));
    let metrics = MEASURES.iter().map(|measure| {
        let mut metric = measured(measure, &document, at);
        metric.is_historical = historical.then_some(true);
        metric
    });
    payload(metrics.collect(), seq)
}

fn payload(metrics: Vec<Metric>, seq: u8) -> Payload {
    Payload { timestamp: Some(now()), metrics, seq: Some(seq.into()), ..Payload::default() }
}

fn bd_seq_metric(bd_seq: u8) -> Metric {
    let mut metric = metric(BDSEQ, DataType::Int64, now());
    metric.set_value(Value::LongValue(bd_seq.into()));
    metric
}

fn state_metrics(state: &PressState) -> [Metric; 3] {
    let texts = [("State", &state.state), ("Error", &state.error)].map(|(name, text)| {
        let mut metric = metric(name, DataType::String, now());
        match text {
            Some(text) => metric.set_value(Value::StringValue(text.clone())),
            None => metric.set_null(),
        };
        metric
    });
    let mut running = metric("Host Running", DataType::Boolean, now());
    running.set_value(Value::BooleanValue(state.running));
    let [state, error] = texts;
    [state, error, running]
}

fn measured(measure: &Measure, document: &Json, at: u64) -> Metric {
    let mut metric = metric(measure.name, measure.kind, at);
    set(&mut metric, document.pointer(measure.place), measure.factor);
    metric
}

/// Sets the value of a metric; null where the message has no value of this type.
fn set(metric: &mut Metric, value: Option<&Json>, factor: f64) {
    let value =
        match (metric.datatype.and_then(|kind| DataType::try_from(i32::try_from(kind).ok()?).ok()), value) {
            (Some(DataType::Int64), Some(value)) => value.as_u64().map(Value::LongValue),
            (Some(DataType::Double), Some(value)) => value.as_f64().map(|it| Value::DoubleValue(factor * it)),
            (Some(DataType::String), Some(value)) => {
                value.as_str().map(|it| Value::StringValue(it.to_owned()))
            }
            _ => None,
        };
    match value {
        Some(value) => metric.set_value(value),
        None => metric.set_null(),
    };
}

fn metric(name: &str, kind: DataType, at: u64) -> Metric {
    let mut metric = Metric::new();
    metric.set_name(name.to_owned()).set_datatype(kind).set_timestamp(at);
    metric
}

fn unit(unit: &str) -> PropertySet {
    let value = PropertyValue {
        r#type: u32::try_from(i32::from(DataType::String)).ok(),
        is_null: None,
        value: Some(property_value::Value::StringValue(unit.to_owned())),
    };
    PropertySet { keys: vec!["engUnit".to_owned()], values: vec![value] }
}

fn document(message: &Message) -> Json {
    serde_json::from_str(&message.text).unwrap_or_default()
}

fn millis(at: &str) -> u64 {
    let at = at.parse::<jiff::Timestamp>().map(jiff::Timestamp::as_millisecond).unwrap_or_default();
    at.unsigned_abs()
}

fn now() -> u64 {
    jiff::Timestamp::now().as_millisecond().unsigned_abs()
}
