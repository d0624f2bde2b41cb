//! Service state for systemd, `sd_notify(3)`: readiness, status text, and the watchdog.
//!
//! The status of the press side changes with each cycle that polls the press. Each change resets the watchdog. If a
//! cycle hangs, the watchdog is not reset and systemd restarts the host. The mode `off` has no cycle; there a timer
//! resets the watchdog.
//!
//! A host that stops needs no watchdog: systemd limits the time of a stop (`TimeoutStopSec=`). It is switched off with
//! the notification, as a reset after `SIGTERM` would start it again, and the last scan may take longer than its period.

use std::time::{Duration, Instant};

use platen_plant::press::Mode;
use platen_press::Status;
use sd_notify::NotifyState;
use tokio::sync::watch;

/// Shortest time between two resets of the watchdog.
const PERIOD: Duration = Duration::from_secs(1);

/// Notifies systemd until the press side ends. Does nothing where systemd did not start the host.
pub(super) async fn keep(mode: Mode, mut status: watch::Receiver<Status>) {
    if std::env::var_os("NOTIFY_SOCKET").is_none() {
        return;
    }
    let mut fed: Option<Instant> = None;
    let mut notified = String::new();
    loop {
        if mode == Mode::Off {
            tokio::time::sleep(PERIOD).await;
        } else if status.changed().await.is_err() {
            return;
        }
        let state = status.borrow_and_update().state.to_string();
        let mut notices = Vec::new();
        if fed.is_none() {
            notices.push(NotifyState::Ready);
        }
        if fed.is_none_or(|fed| fed.elapsed() >= PERIOD) {
            notices.push(NotifyState::Watchdog);
            fed = Some(Instant::now());
        }
        if state != notified {
            notices.push(NotifyState::Status(&state));
        }
        if let Err(error) = sd_notify::notify(&notices) {
            tracing::warn!("systemd cannot be notified: {error}");
        }
        notified = state;
    }
}

/// Notifies systemd that the host is stopping, without a watchdog from now on.
pub(super) fn stopping() {
    // Fails without systemd, which does not matter.
    let _ = sd_notify::notify(&[NotifyState::Stopping, NotifyState::WatchdogUsec(0)]);
}
