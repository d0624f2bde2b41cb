//! Table `[[template]]`: templates on reference lines, with rules of the trade as presets.

use platen_model::{Centre, ReferenceLine, Seat, Template};

use super::NamedLine;
use super::place::Names;
use crate::document::Reported;
use crate::key::Located;
use crate::unit::{metres, millimetres};
use crate::{Document, TomlTable, nearest};

/// Rule of the trade: default length, limit and source of a template.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Preset {
    /// Name in the file.
    name: &'static str,
    /// Length of the template, millimetres.
    chord_mm: f64,
    /// Largest gap, millimetres.
    limit_mm: f64,
    /// Origin of the rule: clause, edition, who typed it in, its reliability and its use.
    source: &'static str,
}

/// Presets. Only rules whose numbers are known are listed; others belong in the plate file with their own `source`.
const PRESETS: &[Preset] = &[
    Preset {
        name: "spherical-petal",
        chord_mm: 2000.0,
        limit_mm: 3.0,
        source: "spherical tank petals, 2 m board, gap up to 3 mm (trade practice, one secondary source; edition not known; \
                 typed in by the project)",
    },
    Preset {
        name: "api-650-peaking",
        chord_mm: 900.0,
        limit_mm: 13.0,
        source: "API 650, 7.5.4, peaking: 900 mm board at nominal radius across a vertical weld, up to 13 mm \
                 (weld seams only: even a flat plate passes it from 7.8 m radius on; edition not known; typed in by the project)",
    },
    Preset {
        name: "api-650-banding",
        chord_mm: 900.0,
        limit_mm: 13.0,
        source: "API 650, 7.5.4, banding: 900 mm straight board across a horizontal weld, up to 13 mm \
                 (weld seams only; lay it along the straight lines of the target; edition not known; typed in by the project)",
    },
];

pub(super) fn read(
    mut table: TomlTable<'_>,
    names: &mut Names,
    lines: Result<&[NamedLine], Reported>,
) -> Result<Template, Reported> {
    let name = name(&mut table, names);
    let presets: Vec<(&str, Preset)> = PRESETS.iter().map(|preset| (preset.name, *preset)).collect();
    let preset = table.choice("preset", &presets).located().optional();
    let line =
        table.name("line").located().required().and_then(|name| on_line(table.document(), &name, lines));
    let (chord, limit) = measures(&mut table, &preset);
    let centre = centre(&mut table);
    let seat = table
        .choice("seat", &[("gravity", Seat::Gravity), ("balanced", Seat::Balanced), ("held", Seat::Held)])
        .or(Seat::Gravity);
    let source = table.name("source").optional();
    let document = table.document();
    table.finish();

    let (line, chord) = (line?, chord?);
    fits(document, line, &chord)?;
    let centre = match centre? {
        Some(centre) => stays_on(document, line, chord.value, centre)?,
        None => Centre::At(line.length() / 2.0),
    };
    let limit = limit?;
    let preset = preset?.map(|preset| preset.value.source_for(chord.value, limit));
    Ok(Template {
        name: name?,
        line: line.name.clone(),
        chord: metres(chord.value),
        centre,
        limit: metres(limit),
        seat: seat?,
        source: source?.or(preset),
    })
}

impl Preset {
    /// Returns the source of a template with these measures; a changed rule is marked as changed.
    fn source_for(&self, chord_mm: f64, limit_mm: f64) -> String {
        if (chord_mm, limit_mm) == (self.chord_mm, self.limit_mm) {
            return self.source.to_owned();
        }
        format!("{}; changed here to {chord_mm} mm board, {limit_mm} mm gap", self.source)
    }
}

/// Reads length and limit, millimetres, from the file or its preset.
fn measures(
    table: &mut TomlTable<'_>,
    preset: &Result<Option<Located<Preset>>, Reported>,
) -> (Result<Located<f64>, Reported>, Result<f64, Reported>) {
    let chord = table.number("chord_mm").above(0.0).located();
    let limit = table.number("limit_mm").above(0.0);
    match preset {
        Ok(None) => (chord.required(), limit.required()),
        Ok(Some(Located { value: preset, place })) => {
            let default = Located { value: preset.chord_mm, place: place.clone() };
            (chord.or(default), limit.or(preset.limit_mm))
        }
        Err(reported) => (chord.optional().and(Err(*reported)), limit.optional().and(Err(*reported))),
    }
}

/// Reads the name; the default follows from the place in the file: the second template is T2.
fn name(table: &mut TomlTable<'_>, names: &mut Names) -> Result<String, Reported> {
    let default = Located { value: format!("T{}", names.number), place: table.place().clone() };
    let name = table.name("name").located().or(default)?;
    names.claim(table, name.value, name.place)
}

/// Returns the line called `name`; a faulty line is not reported again.
fn on_line<'a>(
    document: &Document,
    name: &Located<String>,
    lines: Result<&'a [NamedLine], Reported>,
) -> Result<&'a ReferenceLine, Reported> {
    let lines = lines?;
    let called = |line: &&NamedLine| line.name.as_ref().is_ok_and(|known| *known == name.value);
    if let Some(NamedLine { line, .. }) = lines.iter().find(called) {
        return line.as_ref().map_err(|reported| *reported);
    }
    if let Some(reported) = lines.iter().find_map(|line| line.name.as_ref().err()) {
        return Err(*reported);
    }
    let known: Vec<&str> = lines.iter().filter_map(|line| line.name.as_deref().ok()).collect();
    let advice = match nearest::suggestion(&name.value, known.iter().copied()) {
        near if !near.is_empty() => near,
        _ if known.is_empty() => "; this file has none".to_owned(),
        _ => format!("; the file has {}", known.join(", ")),
    };
    Err(document.absent(&name.place, format!("no reference line is called {:?}{advice}", name.value)))
}

/// Reads `centre_mm`: a number along the line, or "worst".
fn centre(table: &mut TomlTable<'_>) -> Result<Option<Located<Centre>>, Reported> {
    let centre = table.node("centre_mm").try_map(|node| match (&node.kind, crate::table::number(node)) {
        (_, Some(mm)) => Ok(Centre::At(metres(mm))),
        (crate::node::NodeKind::String(word), _) if word == "worst" => Ok(Centre::Worst),
        _ => Err(format!("found {}, expected a number or \"worst\"", node.describe())),
    });
    centre.located().optional()
}

/// Refuses a template longer than its line.
fn fits(document: &Document, line: &ReferenceLine, chord: &Located<f64>) -> Result<(), Reported> {
    let length = millimetres(line.length());
    if chord.value <= length {
        return Ok(());
    }
    let message =
        format!("a template of {} mm is longer than its line {:?} of {length} mm", chord.value, line.name);
    Err(document.fault(&chord.place, message))
}

/// Returns the centre of a template whose ends both lie on its line.
fn stays_on(
    document: &Document,
    line: &ReferenceLine,
    chord_mm: f64,
    centre: Located<Centre>,
) -> Result<Centre, Reported> {
    let Centre::At(at) = centre.value else { return Ok(centre.value) };
    let (at, length) = (millimetres(at), millimetres(line.length()));
    let (first, last) = (chord_mm / 2.0, length - chord_mm / 2.0);
    if (first..=last).contains(&at) {
        return Ok(centre.value);
    }
    let message = format!(
        "found {at}, where the template of {chord_mm} mm hangs over an end of {:?}, {length} mm long; allowed {first} to {last}",
        line.name
    );
    Err(document.fault(&centre.place, message))
}
