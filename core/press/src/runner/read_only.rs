//! Modes that write nothing: `off` and `listen`.

use std::time::Duration;

use platen_plant::press::Press;
use tokio::time::{Instant, sleep_until};

use super::cycle::STATUS;
use super::{Answer, Order, PressSide};
use crate::{Client, Link, LinkError, PressImage, Torn};

/// Runs the mode `off`: no connection.
pub(super) async fn wait_for_stop(mut side: PressSide) {
    while !matches!(side.answers.recv().await, None | Some(Answer::Stop)) {}
}

/// Runs the mode `listen`: reads, reports changes, never writes.
pub(super) async fn listen<L: Link>(press: &Press, mut client: Client<L>, mut side: PressSide) {
    let mut last = None;
    let mut backoff = press.link.backoff_min;
    loop {
        let seen = look(press, &mut client).await;
        let words = seen.as_ref().map_or(Vec::new(), |(words, _)| words.clone());
        let pause = match seen.map(|(_, image)| image) {
            Ok(Ok(image)) => {
                backoff = press.link.backoff_min;
                if last.as_ref() != Some(&image) {
                    last = Some(image.clone());
                    // The receiver is gone: the stop arrives through the other channel.
                    let _ = side.orders.send(Order::Seen(Box::new(image)));
                }
                press.link.poll
            }
            Ok(Err(_)) => Duration::ZERO,
            Err(error) => {
                tracing::warn!(%error, "listening");
                backoff = (backoff * 2).min(press.link.backoff_max);
                backoff
            }
        };
        side.status.send_modify(|status| {
            status.press = last.clone();
            status.words = words;
            status.counts = client.counts().clone();
        });
        let until = Instant::now() + pause;
        while Instant::now() < until {
            tokio::select! {
                answer = side.answers.recv() => if matches!(answer, None | Some(Answer::Stop)) { return },
                // Status update during a long pause.
                () = sleep_until(until.min(Instant::now() + STATUS)) => side.status.send_modify(|_| ()),
            }
        }
    }
}

/// Reads the whole block: its words and their decoded values.
async fn look<L: Link>(
    press: &Press,
    client: &mut Client<L>,
) -> Result<(Vec<u16>, Result<PressImage, Torn>), LinkError> {
    if !client.connected() {
        client.connect().await?;
    }
    let words = client.read(&press.map.read, press.map.read.count).await?;
    let image = PressImage::decode(&press.map, press.press_id, &words);
    Ok((words, image))
}
