//! Minimal host for stroke tests: it does not check the link, keeps no journal and measures nothing.
//!
//! It publishes the bend index as a gap, so that a result under the wrong stroke is detected.

use std::time::Duration;

use platen_sim_press::frame::crc16;
use tokio_modbus::client::Context;
use tokio_modbus::prelude::*;

const H_BASE: u16 = 100;

pub(crate) struct Host {
    link: Context,
    h: [u16; 64],
    taken: Option<(u16, u16, u16)>,
    /// The acknowledge bit was low since the last result, so that a high one refers to this result.
    armed: bool,
}

impl Host {
    pub(crate) fn on(link: Context) -> Host {
        let mut h = [0; 64];
        h[0] = 1;
        h[49] = 4711;
        Host { link, h, taken: None, armed: false }
    }

    pub(crate) async fn read_p(&mut self) -> Vec<u16> {
        self.link.read_holding_registers(0, 32).await.unwrap().unwrap()
    }

    pub(crate) async fn write(&mut self, offset: usize, count: usize) {
        let words = &self.h[offset..offset + count];
        self.link.write_multiple_registers(H_BASE + offset as u16, words).await.unwrap().unwrap();
    }

    /// Runs until it is dropped; `figures` converts the bend index to gap, position and sense.
    pub(crate) async fn run(mut self, figures: impl Fn(u16) -> Figures) {
        self.read_p().await;
        self.link.read_holding_registers(H_BASE, 64).await.unwrap().unwrap();
        let mut beat = tokio::time::Instant::now();
        self.h[2] = 1;
        loop {
            if beat.elapsed() >= Duration::from_millis(100) {
                beat = tokio::time::Instant::now();
                self.h[1] = self.h[1].wrapping_add(1);
                self.write(0, 4).await;
            }
            let p = self.read_p().await;
            let asks = p[2] & (1 << 1 | 1 << 8) != 0 && p[2] & 1 << 5 != 0 && p[3] == p[31];
            let identity = (p[4], p[3], p[29]);
            if asks && self.taken != Some(identity) {
                self.taken = Some(identity);
                self.measure(&p, &figures).await;
                self.armed = false;
                continue;
            }
            let acknowledged = p[2] & 1 << 2 != 0;
            self.armed |= !acknowledged;
            if acknowledged && self.armed && self.h[2] & 1 << 2 != 0 {
                self.h[2] = 1;
                self.write(0, 4).await;
            }
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    }

    async fn measure(&mut self, p: &[u16], figures: impl Fn(u16) -> Figures) {
        self.h[2] = 1 << 1;
        self.h[3] = p[3];
        self.h[5] = p[4];
        self.write(0, 6).await;
        let figures = figures(p[18]);
        [self.h[4], self.h[48], self.h[61]] = [p[3], p[5], p[29]];
        self.h[55] = figures.gap;
        [self.h[57], self.h[58]] = figures.at.map(|mm| mm as u16);
        self.h[60] = figures.sense as u16;
        self.h[8] = self.h[8].wrapping_add(1);
        self.h[53] = self.h[8];
        let bytes: Vec<u8> =
            self.h[3..=51].iter().chain(&self.h[55..=61]).flat_map(|word| word.to_be_bytes()).collect();
        self.h[52] = crc16(&bytes);
        self.write(4, 4).await;
        self.write(9, 55).await;
        self.write(8, 1).await;
        self.h[2] = 1 | 1 << 2 | if figures.sense == 0 { 1 << 3 } else { 1 << 4 };
        self.write(0, 4).await;
    }
}

/// Figures published by the host.
#[derive(Clone, Copy)]
pub(crate) struct Figures {
    /// Gap, 0.01 mm.
    pub(crate) gap: u16,
    /// Position (u, v), mm.
    pub(crate) at: [i16; 2],
    /// Sense: -1 not bent enough, 0 within the limits, +1 bent too far.
    pub(crate) sense: i16,
}

/// Returns a gap equal to the bend index; it never passes.
pub(crate) fn counted(bends: u16) -> Figures {
    Figures { gap: 1000 + bends, at: [2000, 2000], sense: -1 }
}
