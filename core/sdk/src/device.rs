//! Devices that a scanner driver finds in reach.

use std::ffi::c_char;

use platen_abi as abi;

/// A device in reach of a driver.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Device {
    /// Option that identifies it in a plant file, such as `address`.
    pub option: String,
    /// Value of that option.
    pub value: String,
    /// Model and serial number.
    pub about: String,
}

impl Device {
    pub(crate) fn write(&self, out: &mut abi::Device) {
        crate::shim::copy_text(&mut out.option, &self.option);
        crate::shim::copy_text(&mut out.value, &self.value);
        crate::shim::copy_text(&mut out.about, &self.about);
    }

    /// Converts the device that a plugin wrote; invalid UTF-8 in it is replaced.
    #[must_use]
    pub fn from_raw(raw: &abi::Device) -> Self {
        let text = |text: &[c_char]| {
            let bytes: Vec<u8> = text.iter().take_while(|c| **c != 0).map(|c| *c as u8).collect();
            String::from_utf8_lossy(&bytes).into_owned()
        };
        Self { option: text(&raw.option), value: text(&raw.value), about: text(&raw.about) }
    }
}
