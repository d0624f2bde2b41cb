//! State of the plugins' processes, for `platen status` and the engineer's page.

use std::sync::{Arc, Mutex};

use platen_engine::plugin::{Health, Instance, Kind};
use serde::{Deserialize, Serialize};

/// State of every plugin of the plant, set by the measurement worker between its jobs.
pub(super) type PluginStates = Arc<Mutex<Vec<PluginStatus>>>;

/// State of one plugin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PluginStatus {
    /// `scanner`, `flattening`, `comparison` or `advisor`.
    pub kind: String,
    /// Name.
    pub plugin: String,
    /// Process identifier; null in the host's own process, and while it has no process.
    pub process: Option<u32>,
    /// Private memory of its process, MiB.
    pub memory_mib: Option<u64>,
    /// Sandbox in force.
    pub confinement: String,
    /// Faults since the start of the host; after each the process is replaced.
    pub faults: u64,
    /// Reason why it is out of use; null while it is in use.
    pub out_of_use: Option<String>,
    /// State of the instrument, if its driver reports it.
    #[serde(default)]
    pub instrument: Option<InstrumentStatus>,
}

/// State of a scanner; null is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct InstrumentStatus {
    /// Temperature inside, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Charge of the battery, 0 to 1.
    pub battery: Option<f64>,
    /// Angle between the vertical axis and the plumb line, degrees.
    pub tilt_deg: Option<f64>,
    /// The mirror or the window must be cleaned.
    pub dirty: bool,
    /// It runs on its battery.
    pub on_battery: bool,
    /// It has not reached its working temperature.
    pub warming_up: bool,
}

impl From<Health> for InstrumentStatus {
    fn from(health: Health) -> Self {
        Self {
            temperature_c: health.temperature_c,
            battery: health.battery,
            tilt_deg: health.tilt.map(f64::to_degrees),
            dirty: health.dirty,
            on_battery: health.on_battery,
            warming_up: health.warming_up,
        }
    }
}

impl InstrumentStatus {
    /// Returns the known values in one line.
    fn line(self) -> String {
        let parts = [
            self.temperature_c.map(|it| format!("{it:.1} \u{b0}C")),
            self.battery.map(|it| format!("battery {:.0} %", 100.0 * it)),
            self.tilt_deg.map(|it| format!("tilt {it:.3}\u{b0}")),
            self.on_battery.then(|| "on its battery".to_owned()),
            self.warming_up.then(|| "warming up".to_owned()),
            self.dirty.then(|| "DIRTY: clean mirror or window".to_owned()),
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
    }
}

impl PluginStatus {
    /// Returns the state of a plugin; `None` while its job runs.
    pub(super) fn of(instance: &Instance) -> Option<Self> {
        let state = instance.worker_state()?;
        Some(Self {
            kind: instance.descriptor().kind.name().to_owned(),
            plugin: state.plugin,
            process: state.process,
            memory_mib: state.memory.map(|bytes| bytes >> 20),
            confinement: confinement(instance, state.confinement),
            faults: state.faults,
            out_of_use: state.out_of_use,
            instrument: None,
        })
    }

    /// Returns the state in one line.
    pub fn line(&self) -> String {
        if let Some(why) = &self.out_of_use {
            return format!("out of use: {why}");
        }
        let process = self.process.map_or(String::new(), |process| format!("process {process}, "));
        let memory = self.memory_mib.map_or(String::new(), |mib| format!(", {mib} MiB"));
        let faults = match self.faults {
            0 => String::new(),
            1 => ", 1 fault".to_owned(),
            n => format!(", {n} faults"),
        };
        let instrument = self.instrument.map_or(String::new(), |it| format!("; instrument: {}", it.line()));
        format!("{process}{}{memory}{faults}{instrument}", self.confinement)
    }
}

fn confinement(instance: &Instance, holds: platen_engine::plugin::Confinement) -> String {
    if !instance.is_isolated() {
        return "in the host's process: it can end the host".to_owned();
    }
    if instance.descriptor().kind == Kind::Scanner {
        return "free to use files, sockets and devices".to_owned();
    }
    let closed = [(holds.landlock, "files (landlock)"), (holds.seccomp, "sockets and programs (seccomp)")];
    let list = |wanted: bool| {
        let names: Vec<&str> =
            closed.iter().filter(|(held, _)| *held == wanted).map(|(_, name)| *name).collect();
        names.join(", ")
    };
    match (holds.landlock, holds.seccomp) {
        (true, true) => format!("kept from {}", list(true)),
        (false, false) => format!("NOT kept from {}: this kernel cannot", list(false)),
        _ => format!("kept from {}, NOT from {}: this kernel cannot", list(true), list(false)),
    }
}
