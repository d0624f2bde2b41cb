//! Plugin named by the plant file.

use crate::document::{Document, Reported};
use crate::key::Located;
use crate::{Fault, Place, RawOptions, TomlTable};

/// Plugin named by the plant file, its options not yet checked.
#[derive(Debug, Clone, PartialEq)]
pub struct PluginUse {
    /// Name, from which the library's file name follows.
    pub plugin: String,
    /// Options; [`check_options`](crate::check_options) checks them.
    pub options: RawOptions,
    /// Fault at the place of the name, without its message.
    template: Option<Fault>,
}

impl PluginUse {
    /// Makes the use of a plugin that no file names, with the default of every option.
    pub fn by_default(plugin: &str) -> Self {
        Self { plugin: plugin.to_owned(), options: RawOptions::none(plugin), template: None }
    }

    /// Makes the use of a plugin that the file implies by leaving its table out; its faults are reported at `place`.
    pub(super) fn implied(plugin: &str, document: &Document, place: &Place) -> Self {
        Self { template: Some(document.source().fault(place, String::new())), ..Self::by_default(plugin) }
    }

    /// Reads `plugin` and `options`.
    pub(super) fn read(table: &mut TomlTable<'_>) -> Result<Self, Reported> {
        let plugin = table.name("plugin").located().required();
        let options = table.options("options");
        let Located { value: plugin, place } = plugin?;
        let template = Some(table.document().source().fault(&place, String::new()));
        Ok(Self { plugin, options, template })
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
