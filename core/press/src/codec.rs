//! Codec between registers and typed images, according to the register map; pure functions.

mod advice_image;
mod host_image;
mod press_image;
mod words;

pub(crate) use advice_image::STATE;
pub use advice_image::{ADVICE_REGISTERS, AdviceImage};
pub use host_image::{HostImage, describe_outputs, saturates};
pub use press_image::{PressImage, Torn, Wrong, describe_inputs};
pub(crate) use words::{bits, raw_number};
