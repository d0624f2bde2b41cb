//! Tables `[advice]` and `[[die]]`: the advisor of the next stroke, and the dies of the press.

use std::time::Duration;

use platen_model::Die;

use super::PluginUse;
use crate::document::Reported;
use crate::press::{AdviceBlock, Press, RegisterTable, Role};
use crate::unit::metres;
use crate::{Document, Located, TomlTable};

/// Words of `show`.
const SHOWS: [(&str, Show); 3] =
    [("shadow", Show::Shadow), ("screen", Show::Screen), ("screen_and_registers", Show::ScreenAndRegisters)];
/// First of the advice registers: behind those of the built-in map.
const REGISTERS_START: i64 = 164;
/// Largest number of finished plates of the same class that are passed to the advisor.
const LIKE_PLATES: i64 = 20;
/// Deadline of an advice, milliseconds.
const DEADLINE_MS: i64 = 2000;
/// Range of die openings, millimetres.
const OPENING_MM: std::ops::RangeInclusive<f64> = 20.0..=5000.0;
/// Range of punch radii, millimetres.
const PUNCH_RADIUS_MM: std::ops::RangeInclusive<f64> = 1.0..=2000.0;

/// Place where advice is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Show {
    /// Recorded and scored, but not shown.
    #[default]
    Shadow,
    /// On the operator's page and in the report.
    Screen,
    /// As `Screen`, and in registers of their own for a display at the press.
    ScreenAndRegisters,
}

impl Show {
    /// Returns the word of the plant file.
    #[must_use]
    pub fn name(self) -> &'static str {
        SHOWS.iter().find(|(_, show)| *show == self).map_or("", |(name, _)| name)
    }
}

/// Advisor of the next stroke. Without the table there is no advice.
#[derive(Debug, Clone, PartialEq)]
pub struct AdviceUse {
    /// The plugin.
    pub plugin: PluginUse,
    /// Place where its advice is shown.
    pub show: Show,
    /// Largest number of finished plates of the same class that are passed to it.
    pub like_plates: usize,
    /// Time from the result to the advice.
    pub deadline: Duration,
    /// Plates may be turned over on this press and bent back.
    pub turn_over: bool,
}

/// Content of `[advice]` with its registers, which are checked after `[press]`.
#[derive(Debug)]
pub(super) struct ReadAdvice {
    pub(super) advice: AdviceUse,
    /// First register in the addressing of the map, with its place; `None` if no register is written.
    registers: Option<(Located<i64>, bool)>,
}

impl ReadAdvice {
    /// Returns the advice registers of a press.
    ///
    /// # Errors
    /// No press, a press that is the client, or registers that belong to the handshake or lie outside of the
    /// allow-list.
    pub(super) fn registers(
        &self,
        document: &Document,
        press: Option<&Press>,
    ) -> Result<Option<AdviceBlock>, Reported> {
        let Some((start, depth)) = &self.registers else { return Ok(None) };
        let fault = |message: String| Err(document.fault(&start.place, message));
        let Some(press) = press.filter(|press| press.role == Role::Client) else {
            return fault("show = \"screen_and_registers\" needs a [press] of role \"client\"".into());
        };
        let first = i64::from(press.map.address_base.first(RegisterTable::Holding));
        let Ok(wire) = u16::try_from(start.value - first) else {
            return fault(format!("found {}, no holding register of this map", start.value));
        };
        let advice = AdviceBlock { start: wire, depth: *depth };
        let (block, of_map) = (advice.block().addresses(), [&press.map.read, &press.map.write]);
        let last = start.value + i64::from(AdviceBlock::COUNT) - 1;
        let holding =
            of_map.into_iter().filter(|it| it.table == RegisterTable::Holding).map(|it| it.addresses());
        if holding.into_iter().any(|it| it.start < block.end && block.start < it.end) {
            return fault(format!("registers {} to {last} overlap those of the handshake", start.value));
        }
        if press.write.check(wire, AdviceBlock::COUNT).is_err() {
            return fault(format!("registers {} to {last} must stand in press.write.allow", start.value));
        }
        Ok(Some(advice))
    }
}

impl AdviceUse {
    /// Reads `[advice]`; its plugin was read by `named`.
    pub(super) fn read(
        mut table: TomlTable<'_>,
        plugin: Result<PluginUse, Reported>,
    ) -> Result<ReadAdvice, Reported> {
        let show = table.choice("show", &SHOWS).or(Show::default());
        let like_plates = table.integer("like_plates").at_least(0).or(LIKE_PLATES);
        let deadline = table.integer("deadline_ms").in_range(50..=60_000).or(DEADLINE_MS);
        let turn_over = table.bool("turn_over").or(false);
        let implied = Located { value: REGISTERS_START, place: table.place().clone() };
        let start = table.integer("registers_start").in_range(0..=465_535).located().or(implied);
        let depth = table.bool("depth_on_panel").or(false);
        table.finish();
        let (show, start, depth) = (show?, start?, depth?);
        let registers = (show == Show::ScreenAndRegisters).then_some((start, depth));
        let advice = Self {
            plugin: plugin?,
            show,
            like_plates: usize::try_from(like_plates?).unwrap_or_default(),
            deadline: Duration::from_millis(deadline?.unsigned_abs()),
            turn_over: turn_over?,
        };
        Ok(ReadAdvice { advice, registers })
    }
}

/// Reads an element of `[[die]]`.
pub(super) fn read_die(mut table: TomlTable<'_>) -> Result<Die, Reported> {
    let id = table.integer("id").in_range(1..=i64::from(u16::MAX)).required();
    let opening = table.number("opening_mm").in_range(OPENING_MM).map(metres).required();
    let edge = table.number("edge_mm").at_least(0.0).map(metres).optional();
    let punch_radius = table.number("punch_radius_mm").in_range(PUNCH_RADIUS_MM).map(metres).optional();
    table.finish();
    let opening = opening?;
    // Both shoulders under the plate, plus a margin.
    let edge = edge?.unwrap_or(0.5 * opening + 0.02);
    Ok(Die { id: u16::try_from(id?).unwrap_or(u16::MAX), opening, edge, punch_radius: punch_radius? })
}
