//! Static description of a plugin.

use std::ffi::CStr;

/// Static description of a plugin.
#[derive(Debug, Clone, Copy)]
pub struct Info {
    pub(crate) id: &'static CStr,
    pub(crate) name: &'static CStr,
    pub(crate) doc: &'static CStr,
    pub(crate) version: &'static CStr,
    pub(crate) vendor: &'static CStr,
    pub(crate) license: &'static CStr,
    pub(crate) flags: u32,
}

impl Info {
    /// Creates a description: `id` as in plant files, display name, one or two sentences, version. Vendor and licence
    /// are those of platen unless they are set by [`by`](Self::by).
    pub const fn new(
        id: &'static CStr,
        name: &'static CStr,
        doc: &'static CStr,
        version: &'static CStr,
    ) -> Self {
        Self { id, name, doc, version, vendor: c"platen", license: c"MIT OR Apache-2.0", flags: 0 }
    }

    /// Sets the vendor, and the licence as an SPDX expression.
    #[must_use]
    pub const fn by(mut self, vendor: &'static CStr, license: &'static CStr) -> Self {
        self.vendor = vendor;
        self.license = license;
        self
    }

    /// Marks the plugin as driving hardware.
    #[must_use]
    pub const fn hardware(mut self) -> Self {
        self.flags |= platen_abi::desc_flag::HARDWARE;
        self
    }
}
