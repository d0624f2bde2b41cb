//! Records of the plugins of a measurement, for its document.

use platen_engine::plugin::Instance;
use platen_report::result::PluginRecord;

/// Returns the records of these plugins, and whether a job of each was repeated.
pub(crate) fn records<'a>(instances: impl IntoIterator<Item = &'a Instance>) -> Vec<PluginRecord> {
    let record = |instance: &Instance| PluginRecord {
        kind: instance.descriptor().kind.name().to_owned(),
        plugin: instance.name().to_owned(),
        version: instance.descriptor().version.clone(),
        sha256: instance.sha256(),
        isolated: instance.is_isolated(),
        retried: instance.take_retried(),
    };
    instances.into_iter().map(record).collect()
}
