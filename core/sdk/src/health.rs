//! State of a scanner between jobs.

use platen_abi as abi;
use platen_abi::health_flag;

/// State of an instrument; `None` where it is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Health {
    /// Temperature inside, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Charge of the battery, 0 to 1.
    pub battery: Option<f64>,
    /// Angle between the instrument's vertical axis and the plumb line, radians.
    pub tilt: Option<f64>,
    /// Mirror or window must be cleaned.
    pub dirty: bool,
    /// The instrument runs on its battery.
    pub on_battery: bool,
    /// The instrument has not reached its working temperature.
    pub warming_up: bool,
}

impl Health {
    pub(crate) fn to_raw(self) -> abi::Health {
        let flag = |set: bool, bit| if set { bit } else { 0 };
        abi::Health {
            struct_size: size_of::<abi::Health>() as u32,
            flags: flag(self.dirty, health_flag::DIRTY)
                | flag(self.on_battery, health_flag::ON_BATTERY)
                | flag(self.warming_up, health_flag::WARMING_UP),
            temperature_c: self.temperature_c.unwrap_or(f64::NAN),
            battery: self.battery.unwrap_or(f64::NAN),
            tilt: self.tilt.unwrap_or(f64::NAN),
        }
    }

    /// Converts the state that a plugin wrote.
    #[must_use]
    pub fn from_raw(raw: &abi::Health) -> Self {
        let known = |value: f64| value.is_finite().then_some(value);
        let flag = |bit| raw.flags & bit != 0;
        Self {
            temperature_c: known(raw.temperature_c),
            battery: known(raw.battery),
            tilt: known(raw.tilt),
            dirty: flag(health_flag::DIRTY),
            on_battery: flag(health_flag::ON_BATTERY),
            warming_up: flag(health_flag::WARMING_UP),
        }
    }
}
