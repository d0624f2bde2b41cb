//! Connection to an MQTT 5 broker: at most 20 publications in flight, and publications received from the broker.
//!
//! A connection is never resumed: after a failure a new one is opened, and changes that were not acknowledged are sent
//! again from the cursor. The client's own list of pending messages is therefore never used.

use std::sync::Arc;
use std::time::Duration;

use platen_plant::SinkUse;
use rumqttc::v5::mqttbytes::QoS;
use rumqttc::v5::mqttbytes::v5::{
    ConnectReturnCode, DisconnectReasonCode, LastWill, Packet, PubAckReason, Publish, PublishProperties,
};
use rumqttc::v5::{AsyncClient, ConnectionError, Event, EventLoop, MqttOptions, StateError};
use rumqttc::{TlsConfiguration, Transport};
use tokio::time::Instant;

use crate::sink::{ANSWER, SinkError};
use crate::{ForwardError, tls};

/// Largest number of publications that wait for an acknowledgement at a time.
const IN_FLIGHT: u16 = 20;
/// Time without traffic after which the connection is tested.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// Address of a broker.
#[derive(Debug, Clone)]
pub(crate) struct Address {
    host: String,
    port: u16,
    user: String,
    password: Option<String>,
    tls: Option<Arc<rustls::ClientConfig>>,
}

/// A publication.
#[derive(Debug, Clone)]
pub(crate) struct Publication {
    pub(crate) topic: String,
    pub(crate) payload: Vec<u8>,
    /// True when the broker acknowledges it.
    pub(crate) acknowledged: bool,
    pub(crate) retain: bool,
    pub(crate) content_type: Option<&'static str>,
}

/// Connection to a broker.
pub(crate) struct Connection {
    client: AsyncClient,
    events: EventLoop,
    place: String,
    /// Received publications that have not been taken yet.
    received: Vec<Publish>,
}

impl Address {
    pub(crate) fn of(sink: &SinkUse) -> Result<Self, ForwardError> {
        Ok(Self {
            host: sink.host.clone(),
            port: sink.port,
            user: sink.user.clone(),
            password: tls::password(sink)?,
            tls: tls::config(sink)?.map(Arc::new),
        })
    }
}

impl Connection {
    /// Connects under a client id; the broker publishes `will` when the connection breaks.
    pub(crate) async fn open(
        address: &Address,
        client_id: &str,
        will: Publication,
    ) -> Result<Self, SinkError> {
        let place = format!("{}:{}", address.host, address.port);
        let mut options = MqttOptions::new(client_id, address.host.as_str(), address.port);
        options.set_keep_alive(KEEP_ALIVE).set_clean_start(true).set_connection_timeout(ANSWER.as_secs());
        options.set_outgoing_inflight_upper_limit(IN_FLIGHT);
        if let Some(password) = &address.password {
            options.set_credentials(address.user.as_str(), password.as_str());
        }
        if let Some(tls) = &address.tls {
            options.set_transport(Transport::tls_with_config(TlsConfiguration::Rustls(Arc::clone(tls))));
        }
        let quality = quality(will.acknowledged);
        options.set_last_will(LastWill::new(will.topic, will.payload, quality, will.retain, None));
        let (client, events) = AsyncClient::new(options, usize::from(2 * IN_FLIGHT));
        let mut connection = Self { client, events, place, received: Vec::new() };
        let end = Instant::now() + 2 * ANSWER;
        while !matches!(connection.event(end).await?, Event::Incoming(Packet::ConnAck(_))) {}
        Ok(connection)
    }

    /// Publishes in order. Returns when the broker has acknowledged each publication that requires it and the others
    /// have been sent.
    pub(crate) async fn publish(&mut self, publications: Vec<Publication>) -> Result<(), SinkError> {
        let mut waiting = publications.into_iter();
        let mut next = waiting.next();
        let (mut unsent, mut unacknowledged) = (0_usize, 0_usize);
        let mut end = Instant::now() + ANSWER;
        loop {
            while let Some(one) = next.take_if(|_| unsent + unacknowledged < usize::from(IN_FLIGHT)) {
                (unsent, unacknowledged) = (unsent + 1, unacknowledged + usize::from(one.acknowledged));
                let properties = PublishProperties {
                    content_type: one.content_type.map(str::to_owned),
                    ..PublishProperties::default()
                };
                let queued = self.client.try_publish_with_properties(
                    one.topic,
                    quality(one.acknowledged),
                    one.retain,
                    one.payload,
                    properties,
                );
                queued.map_err(|e| self.unavailable(&e.to_string()))?;
                next = waiting.next();
            }
            if unsent + unacknowledged == 0 && next.is_none() {
                return Ok(());
            }
            match self.event(end).await? {
                Event::Outgoing(rumqttc::Outgoing::Publish(_)) => unsent = unsent.saturating_sub(1),
                Event::Incoming(Packet::PubAck(ack)) => {
                    self.accept(ack.reason)?;
                    unacknowledged = unacknowledged.saturating_sub(1);
                    end = Instant::now() + ANSWER;
                }
                _ => {}
            }
        }
    }

    /// Subscribes to a topic.
    pub(crate) fn subscribe(&mut self, topic: &str) -> Result<(), SinkError> {
        self.client.try_subscribe(topic, QoS::AtLeastOnce).map_err(|e| self.unavailable(&e.to_string()))
    }

    /// Keeps the connection alive for a time, or until a publication is received.
    pub(crate) async fn idle(&mut self, time: Duration) -> Result<(), SinkError> {
        let end = Instant::now() + time;
        while self.received.is_empty() {
            match tokio::time::timeout_at(end, self.events.poll()).await {
                Ok(event) => drop(self.sort(event)?),
                Err(_) => return Ok(()),
            }
        }
        Ok(())
    }

    /// Takes the received publications.
    pub(crate) fn take_received(&mut self) -> Vec<Publish> {
        std::mem::take(&mut self.received)
    }

    /// Ends the connection; the broker drops the will.
    pub(crate) async fn close(mut self) {
        if self.client.try_disconnect().is_ok() {
            let end = Instant::now() + ANSWER;
            // Wait for the end of the connection.
            while !matches!(
                self.event(end).await,
                Err(_) | Ok(Event::Outgoing(rumqttc::Outgoing::Disconnect))
            ) {}
        }
    }

    async fn event(&mut self, end: Instant) -> Result<Event, SinkError> {
        match tokio::time::timeout_at(end, self.events.poll()).await {
            Ok(event) => self.sort(event),
            Err(_) => Err(SinkError::silent(&self.place)),
        }
    }

    fn sort(&mut self, event: Result<Event, ConnectionError>) -> Result<Event, SinkError> {
        let event = event.map_err(|e| self.unavailable(&explain(&e)))?;
        if let Event::Incoming(Packet::Publish(publish)) = &event {
            self.received.push(publish.clone());
        }
        Ok(event)
    }

    fn accept(&self, reason: PubAckReason) -> Result<(), SinkError> {
        match reason {
            PubAckReason::Success | PubAckReason::NoMatchingSubscribers => Ok(()),
            PubAckReason::NotAuthorized => {
                Err(self
                    .unavailable("the broker does not let this user publish here; look at its access list"))
            }
            PubAckReason::PayloadFormatInvalid => {
                Err(SinkError::Refused("the broker finds its format invalid".to_owned()))
            }
            other => Err(self.unavailable(&format!("the broker does not take a message: {other:?}"))),
        }
    }

    fn unavailable(&self, why: &str) -> SinkError {
        SinkError::Unavailable(format!("{}: {why}", self.place))
    }
}

fn quality(acknowledged: bool) -> QoS {
    if acknowledged { QoS::AtLeastOnce } else { QoS::AtMostOnce }
}

/// Returns a sentence that includes the action to take.
fn explain(error: &ConnectionError) -> String {
    match error {
        ConnectionError::ConnectionRefused(code)
        | ConnectionError::MqttState(StateError::ConnFail { reason: code }) => match code {
            ConnectReturnCode::BadUserNamePassword | ConnectReturnCode::NotAuthorized => {
                "the broker refuses the user or the password; look at user and password_file".to_owned()
            }
            other => format!("the broker refuses the connection: {other:?}"),
        },
        ConnectionError::MqttState(StateError::ServerDisconnect {
            reason_code: DisconnectReasonCode::SessionTakenOver,
            ..
        })
        | ConnectionError::MqttState(StateError::ConnectionAborted) => {
            // Not every broker gives a reason: mosquitto 2.0.11 closes the connection without a message when a client
            // id is used twice, and when its access list refuses the user.
            "the broker closed the connection; where this comes again and again, its access list is against this user, or another \
             client has this press's name"
                .to_owned()
        }
        ConnectionError::Timeout(_) => {
            format!("no answer in {} s; look at the broker and the network", ANSWER.as_secs())
        }
        ConnectionError::Tls(error) => format!("{error}; look at ca_file, host and the broker's certificate"),
        other => other.to_string(),
    }
}
