//! MQTT 5 sink: strokes and alarms as JSON at QoS 1, and the retained state of the press.
//!
//! | topic | content |
//! |---|---|
//! | `platen/v1/SITE/PRESS/stroke` | [`platen.stroke/1`](crate::message) of kinds accepted, finished, acked, plate |
//! | `platen/v1/SITE/PRESS/alarm` | the same of kind event |
//! | `platen/v1/SITE/PRESS/state` | retained: `platen.state/1`; the will states that forwarding has stopped |
//!
//! Delivery is at least once: a consumer drops duplicates by site, press, owner, kind and id.

pub(crate) mod connection;

use std::path::PathBuf;
use std::time::Duration;

use platen_history::Owner;
use platen_plant::SinkUse;

use crate::ForwardError;
use crate::message::{Message, Names};
use crate::press_state::PressState;
use crate::sink::{Receipt, Sink, SinkError};
use connection::{Address, Connection, Publication};

/// Largest number of messages of one delivery.
const BATCH: u32 = 100;
const JSON: Option<&str> = Some("application/json");

/// Sink of an MQTT broker.
pub(crate) struct MqttSink {
    address: Address,
    client_id: String,
    /// `platen/v1/SITE/PRESS`.
    topic: String,
    /// Folder in which the host keeps its state.
    folder: PathBuf,
    published: Option<PressState>,
    connection: Option<Connection>,
}

impl MqttSink {
    pub(crate) fn new(sink: &SinkUse, names: &Names, folder: &std::path::Path) -> Result<Self, ForwardError> {
        Ok(Self {
            address: Address::of(sink)?,
            client_id: format!("platen-{}-{}", names.site, names.press),
            topic: format!("platen/v1/{}/{}", names.site, names.press),
            folder: folder.to_owned(),
            published: None,
            connection: None,
        })
    }

    fn connection(&mut self) -> Result<&mut Connection, SinkError> {
        self.connection.as_mut().ok_or_else(|| SinkError::Unavailable("not connected".to_owned()))
    }

    fn state(&self, state: &PressState) -> Publication {
        Publication {
            topic: format!("{}/state", self.topic),
            payload: state.json(),
            acknowledged: true,
            retain: true,
            content_type: JSON,
        }
    }

    /// Publishes the state of the press if it has changed.
    async fn publish_state(&mut self) -> Result<(), SinkError> {
        let now = PressState::load(&self.folder);
        if self.published.as_ref() != Some(&now) {
            let state = self.state(&now);
            self.connection()?.publish(vec![state]).await?;
            self.published = Some(now);
        }
        Ok(())
    }
}

impl Sink for MqttSink {
    async fn connect(&mut self) -> Result<(), SinkError> {
        (self.connection, self.published) = (None, None);
        let will = self.state(&PressState::nobody());
        self.connection = Some(Connection::open(&self.address, &self.client_id, will).await?);
        // The newest state first, then the changes that were not sent.
        self.publish_state().await
    }

    async fn deliver(&mut self, messages: &[Message], _: &[Owner]) -> Result<Receipt, SinkError> {
        self.publish_state().await?;
        let publications = messages.iter().map(|message| Publication {
            topic: format!("{}/{}", self.topic, if message.key.kind == "event" { "alarm" } else { "stroke" }),
            payload: message.text.clone().into_bytes(),
            acknowledged: true,
            retain: false,
            content_type: JSON,
        });
        let publications = publications.collect();
        self.connection()?.publish(publications).await?;
        Ok(Receipt::default())
    }

    async fn idle(&mut self, time: Duration) -> Result<(), SinkError> {
        self.publish_state().await?;
        self.connection()?.idle(time).await
    }

    async fn close(&mut self) {
        if self.connection.is_some() {
            let nobody = self.state(&PressState::nobody());
            if let Some(mut connection) = self.connection.take() {
                // The broker publishes the will only after a broken connection.
                let _ = connection.publish(vec![nobody]).await;
                connection.close().await;
            }
        }
    }

    fn batch(&self) -> u32 {
        BATCH
    }
}
