//! Registers to typed images and back, after the register map. Pure.

mod host_image;
mod press_image;
mod words;

pub use host_image::{HostImage, describe_outputs, saturates};
pub use press_image::{PressImage, Torn, Wrong, describe_inputs};
pub(crate) use words::{bits, raw_number};
