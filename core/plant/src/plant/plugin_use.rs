//! One plugin as the plant file names it.

use crate::document::Reported;
use crate::key::Located;
use crate::{Fault, RawOptions, TomlTable};

/// One plugin as the plant file names it, its options not yet checked.
#[derive(Debug, Clone, PartialEq)]
pub struct PluginUse {
    /// Name of the plugin, as its library is found.
    pub plugin: String,
    /// Its options; [`check_options`](crate::check_options) checks them.
    pub options: RawOptions,
    /// The fault to report with another message, at the place of the name.
    template: Option<Fault>,
}

impl PluginUse {
    /// A plugin that no file names, with the default of every option.
    pub fn by_default(plugin: &str) -> Self {
        Self { plugin: plugin.to_owned(), options: RawOptions::none(plugin), template: None }
    }

    pub(super) fn read(table: TomlTable<'_>) -> Result<Self, Reported> {
        Self::read_with(table, |_| Ok(())).map(|(plugin, ())| plugin)
    }

    /// A plugin in a table that holds further keys, which `more` reads.
    pub(super) fn read_with<T>(
        mut table: TomlTable<'_>,
        more: impl FnOnce(&mut TomlTable<'_>) -> Result<T, Reported>,
    ) -> Result<(Self, T), Reported> {
        let plugin = table.name("plugin").located().required();
        let options = table.options("options");
        let document = table.document();
        let more = more(&mut table);
        table.finish();
        let Located { value: plugin, place } = plugin?;
        let template = Some(document.source().fault(&place, String::new()));
        Ok((Self { plugin, options: options?, template }, more?))
    }

    /// A fault of this choice of plugin, at its place in the plant file: it is not installed, or refuses.
    pub fn fault(&self, message: impl Into<String>) -> Fault {
        let message = message.into();
        match &self.template {
            Some(fault) => Fault { message, ..fault.clone() },
            None => self.options.fault(message),
        }
    }
}
