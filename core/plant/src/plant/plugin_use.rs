//! Plugin specified in the plant file.

use crate::document::{Document, Reported};
use crate::key::Located;
use crate::{Fault, Place, RawOptions, TomlTable};

/// Process in which a plugin runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Worker {
    /// `isolation = "in-process"`: a thread of the host instead, for a debugger.
    pub in_process: bool,
    /// `memory_mib`: private memory.
    pub memory_mib: u64,
    /// `files`: open files.
    pub files: u64,
    /// `pool_mib`: memory for frames in transit to the host.
    pub pool_mib: u64,
}

impl Default for Worker {
    fn default() -> Self {
        Self { in_process: false, memory_mib: 2048, files: 256, pool_mib: 64 }
    }
}

impl Worker {
    fn read(table: &mut TomlTable<'_>) -> Result<Self, Reported> {
        let default = Self::default();
        let places = [("process", false), ("in-process", true)];
        let in_process = table.choice("isolation", &places).or(default.in_process);
        let mut number = |key, range, or| table.integer(key).in_range(range).map(i64::unsigned_abs).or(or);
        let memory_mib = number("memory_mib", 64..=1 << 20, default.memory_mib);
        let files = number("files", 16..=1 << 16, default.files);
        let pool_mib = number("pool_mib", 1..=1 << 14, default.pool_mib);
        Ok(Self { in_process: in_process?, memory_mib: memory_mib?, files: files?, pool_mib: pool_mib? })
    }
}

/// Plugin named by the plant file, its options not yet checked.
#[derive(Debug, Clone, PartialEq)]
pub struct PluginUse {
    /// Name, which determines the file name of the library.
    pub plugin: String,
    /// Options; [`check_options`](crate::check_options) checks them.
    pub options: RawOptions,
    /// Process in which it runs.
    pub worker: Worker,
    /// `fills_registers`: a comparison whose figures go to the press.
    pub fills_registers: bool,
    /// Fault at the place of the name, without its message.
    template: Option<Fault>,
}

impl PluginUse {
    /// Makes the use of a plugin that no file names, with the default of every option.
    pub fn by_default(plugin: &str) -> Self {
        let options = RawOptions::none(plugin);
        let worker = Worker::default();
        Self { plugin: plugin.to_owned(), options, worker, fills_registers: false, template: None }
    }

    /// Makes the use of a plugin that the file implies by leaving its table out; its faults are reported at `place`.
    pub(super) fn implied(plugin: &str, document: &Document, place: &Place) -> Self {
        Self { template: Some(document.source().fault(place, String::new())), ..Self::by_default(plugin) }
    }

    /// Reads `plugin`, `options` and the keys of its process.
    pub(super) fn read(table: &mut TomlTable<'_>) -> Result<Self, Reported> {
        let plugin = table.name("plugin").located().required();
        let options = table.options("options");
        let worker = Worker::read(table);
        let Located { value: plugin, place } = plugin?;
        let template = Some(table.document().source().fault(&place, String::new()));
        Ok(Self { plugin, options, worker: worker?, fills_registers: false, template })
    }

    /// Makes a fault of this choice of plugin, at its place in the plant file.
    pub fn fault(&self, message: impl Into<String>) -> Fault {
        let message = message.into();
        match &self.template {
            Some(fault) => Fault { message, ..fault.clone() },
            None => self.options.fault(message),
        }
    }
}
