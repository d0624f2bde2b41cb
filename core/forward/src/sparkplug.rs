//! Sparkplug B 3.0 sink: a live view for SCADA.
//!
//! The group is the site, the edge node the press, its only device the scanner. Strokes from before the birth of the
//! session are marked as historical. Where a primary host application is named, the node is born only while that
//! application is online, and dies when it goes offline; strokes in the meantime are sent as history.
//!
//! Limit: the standard requires QoS 0 for data (`tck-id-payloads-ddata-qos`). Delivery is therefore not guaranteed: a
//! cursor moves when a stroke was sent, not when it was received.

mod metrics;
mod session;

use std::path::PathBuf;
use std::time::Duration;

use jiff::Timestamp;
use platen_history::Owner;
use platen_plant::SinkUse;
use srad_types::constants::{DBIRTH, DDATA, NBIRTH, NCMD, NDATA, NDEATH, SPBV01};
use srad_types::payload::Payload;
use tokio::time::Instant;

use crate::ForwardError;
use crate::cursor::SharedCursors;
use crate::message::{Message, Names};
use crate::mqtt::connection::{Address, Connection, Publication};
use crate::press_state::PressState;
use crate::sink::{Receipt, Sink, SinkError};
use session::{Heard, Session};

/// The device of the node.
const DEVICE: &str = "scanner";
/// Largest number of messages of one delivery.
const BATCH: u32 = 20;
/// Longest wait for the primary host application before a new connection is opened.
const PRIMARY_HOST: Duration = Duration::from_secs(60);
/// Time between two checks of the received messages.
const LOOK: Duration = Duration::from_millis(500);

/// Sink of a Sparkplug host application.
pub(crate) struct SparkplugSink {
    address: Address,
    name: String,
    names: Names,
    primary_host: Option<String>,
    /// Folder in which the host keeps its state.
    folder: PathBuf,
    cursors: SharedCursors,
    live: Option<Live>,
}

/// Connection with its session.
struct Live {
    connection: Connection,
    session: Session,
    published: PressState,
    /// Metrics of the last stroke, for a rebirth.
    last: Option<Message>,
}

impl SparkplugSink {
    pub(crate) fn new(
        sink: &SinkUse,
        names: &Names,
        folder: &std::path::Path,
        cursors: SharedCursors,
    ) -> Result<Self, ForwardError> {
        Ok(Self {
            address: Address::of(sink)?,
            name: sink.name.clone(),
            names: names.clone(),
            primary_host: sink.primary_host.clone(),
            folder: folder.to_owned(),
            cursors,
            live: None,
        })
    }

    fn publication(&self, kind: &str, payload: Payload) -> Publication {
        let device = if kind.starts_with('D') { format!("/{DEVICE}") } else { String::new() };
        Publication {
            topic: format!("{SPBV01}/{}/{kind}/{}{device}", self.names.site, self.names.press),
            payload: payload.into(),
            acknowledged: false,
            retain: false,
            content_type: None,
        }
    }

    fn death(&self, bd_seq: u8) -> Publication {
        // tck-id-payloads-ndeath-will-message-qos: 1.
        Publication { acknowledged: true, ..self.publication(NDEATH, metrics::death(bd_seq)) }
    }

    fn live(&mut self) -> Result<&mut Live, SinkError> {
        self.live.as_mut().ok_or_else(|| SinkError::Unavailable("not connected".to_owned()))
    }

    /// Publishes the births of node and device.
    async fn give_birth(&mut self) -> Result<(), SinkError> {
        let state = PressState::load(&self.folder);
        let live = self.live()?;
        let numbers = live.session.born(Timestamp::now());
        let births = [
            (NBIRTH, metrics::node_birth(&state, live.session.bd_seq(), numbers[0])),
            (DBIRTH, metrics::device_birth(live.last.as_ref(), numbers[1])),
        ];
        live.published = state;
        let births = births.map(|(kind, payload)| self.publication(kind, payload)).to_vec();
        self.live()?.connection.publish(births).await
    }

    /// Processes the messages received from the broker.
    async fn hear(&mut self) -> Result<(), SinkError> {
        let live = self.live()?;
        for publish in live.connection.take_received() {
            let topic = String::from_utf8_lossy(&publish.topic).into_owned();
            match self.live()?.session.hear(&topic, &publish.payload) {
                Heard::Nothing => {}
                Heard::Rebirth => self.give_birth().await?,
                Heard::PrimaryOnline => {
                    if !self.live()?.session.is_born() {
                        self.give_birth().await?;
                    }
                }
                Heard::PrimaryOffline => {
                    // tck-id-message-flow-edge-node-birth-publish-phid-offline: death, then disconnect.
                    self.close().await;
                    return Err(self.without_primary());
                }
            }
        }
        Ok(())
    }

    /// Publishes the press's state if it has changed.
    async fn publish_state(&mut self) -> Result<(), SinkError> {
        let state = PressState::load(&self.folder);
        let live = self.live()?;
        if live.published != state {
            let seq = live.session.next_seq();
            live.published = state.clone();
            let change = self.publication(NDATA, metrics::node_data(&state, seq));
            self.live()?.connection.publish(vec![change]).await?;
        }
        Ok(())
    }

    fn without_primary(&self) -> SinkError {
        let host = self.primary_host.as_deref().unwrap_or_default();
        SinkError::Unavailable(format!(
            "the primary host application {host} is offline; strokes are sent as history when it is back"
        ))
    }
}

impl Sink for SparkplugSink {
    async fn connect(&mut self) -> Result<(), SinkError> {
        let last = self.live.take().and_then(|live| live.last);
        let bd_seq = self.cursors.lock().next_birth(&self.name);
        let bd_seq = bd_seq.map_err(|e| SinkError::Unavailable(e.to_string()))?;
        let client_id = format!("platen-sparkplug-{}-{}", self.names.site, self.names.press);
        let mut connection = Connection::open(&self.address, &client_id, self.death(bd_seq)).await?;
        connection.subscribe(&format!("{SPBV01}/{}/{NCMD}/{}", self.names.site, self.names.press))?;
        if let Some(host) = &self.primary_host {
            connection.subscribe(&format!("{SPBV01}/STATE/{host}"))?;
        }
        let session = Session::new(&self.names, self.primary_host.as_deref(), bd_seq);
        self.live = Some(Live { connection, session, published: PressState::nobody(), last });
        if self.primary_host.is_none() {
            return self.give_birth().await;
        }
        let end = Instant::now() + PRIMARY_HOST;
        while !self.live()?.session.is_born() {
            if Instant::now() >= end {
                self.live = None;
                return Err(self.without_primary());
            }
            self.live()?.connection.idle(LOOK).await?;
            self.hear().await?;
        }
        Ok(())
    }

    async fn deliver(&mut self, messages: &[Message], _: &[Owner]) -> Result<Receipt, SinkError> {
        self.hear().await?;
        self.publish_state().await?;
        let mut publications = Vec::new();
        for message in messages {
            let live = self.live()?;
            let historical = live.session.is_historical(&message.at);
            let (kind, payload) = match message.key.kind.as_str() {
                "finished" => {
                    live.last = Some(message.clone());
                    (DDATA, metrics::device_data(message, historical, live.session.next_seq()))
                }
                "event" => (NDATA, metrics::alarm(message, historical, live.session.next_seq())),
                _ => continue,
            };
            publications.push(self.publication(kind, payload));
        }
        self.live()?.connection.publish(publications).await?;
        Ok(Receipt::default())
    }

    async fn idle(&mut self, time: Duration) -> Result<(), SinkError> {
        self.publish_state().await?;
        self.live()?.connection.idle(time).await?;
        self.hear().await
    }

    async fn close(&mut self) {
        if let Some(mut live) = self.live.take() {
            let death = self.death(live.session.bd_seq());
            // tck-id-operational-behavior-edge-node-intentional-disconnect-ndeath: death is published before the end.
            let _ = live.connection.publish(vec![death]).await;
            live.connection.close().await;
        }
    }

    fn batch(&self) -> u32 {
        BATCH
    }
}
