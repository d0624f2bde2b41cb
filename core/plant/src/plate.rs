//! Plate file: a plate, its target, and the points, lines and templates to be evaluated.

mod edges;
mod place;
mod target;
mod template;

use std::path::Path;

use platen_model::{
    Marker, Plate, Quantity, ReferenceLine, Station, Steel, Support, Target, Task, Template, TrimLine,
};

use crate::document::{Document, Reported};
use crate::unit::metres;
use crate::{Error, Faults, TomlTable};
use edges::EdgeKeys;
use place::{Names, Rectangle};

/// Range of a plate's sides, millimetres: wide enough for the 2-5 m of the trade, narrow enough to refuse metres.
const SIDE_MM: std::ops::RangeInclusive<f64> = 100.0..=20_000.0;
/// Range of the yield strength of steel, MPa.
const YIELD_MPA: std::ops::RangeInclusive<f64> = 100.0..=2000.0;
/// Range of thickness, millimetres.
const THICKNESS_MM: std::ops::RangeInclusive<f64> = 1.0..=300.0;

/// Checked plate file. Lengths in metres, angles in radians, places as (u, v) on the original rectangle.
#[derive(Debug, Clone, PartialEq)]
pub struct PlateFile {
    /// Plate as ordered.
    pub plate: Plate,
    /// Steel, for the advice of the next stroke.
    pub steel: Option<Steel>,
    /// Target shape; without it nothing can be judged.
    pub target: Option<Target>,
    /// Markers to be reported.
    pub markers: Vec<Marker>,
    /// Lines to be reported, on which templates lie.
    pub reference_lines: Vec<ReferenceLine>,
    /// Points on the supports of the press during a scan.
    pub supports: Vec<Support>,
    /// Templates to be laid on the plate.
    pub templates: Vec<Template>,
    /// Stations, in the order of the press's station registers.
    pub stations: Vec<Station>,
    /// Lines along which the formed plate is cut.
    pub trim_lines: Vec<TrimLine>,
}

/// Reference line and its name. The name is kept if the line is faulty, so that a template on it is not a second fault.
#[derive(Debug, Clone)]
struct NamedLine {
    name: Result<String, Reported>,
    line: Result<ReferenceLine, Reported>,
}

impl PlateFile {
    /// Reads a plate file.
    ///
    /// # Errors
    /// [`Error::Unreadable`], or [`Error::Faulty`] with every fault of the file.
    pub fn load(path: &Path) -> Result<Self, Error> {
        Ok(Self::take(Document::load(path)?)?)
    }

    /// Checks the text of a plate file; `file` is its name in messages.
    ///
    /// # Errors
    /// Every fault of the text.
    pub fn parse(file: &str, text: &str) -> Result<Self, Faults> {
        Self::take(Document::parse(file, text))
    }

    /// Returns the task of the comparisons for this plate. `sigma_correlated` and `sigma_true` are the scanner's
    /// errors, metres.
    pub fn task(&self, sigma_correlated: f64, sigma_true: Option<f64>, supports_changed: bool) -> Task {
        Task {
            plate: self.plate.id.clone(),
            width: self.plate.width,
            height: self.plate.height,
            thickness: self.plate.thickness,
            target: self.target,
            reference_lines: self.reference_lines.clone(),
            templates: self.templates.clone(),
            stations: self.stations.clone(),
            sigma_correlated,
            sigma_true,
            supports: self.supports.clone(),
            supports_changed,
        }
    }

    /// Returns whether a document is a plate file: it has a table `[plate]`.
    pub fn recognises(document: &Document) -> bool {
        document.root().has("plate")
    }

    /// Checks a parsed document.
    ///
    /// # Errors
    /// Every fault of the document.
    pub fn take(document: Document) -> Result<Self, Faults> {
        let file = Self::read(document.root());
        document.finish(file)
    }

    fn read(mut root: TomlTable<'_>) -> Result<Self, Reported> {
        let mut rectangle = None;
        let plate = root.table("plate").required().and_then(|table| read_plate(table, &mut rectangle));
        let steel = root.table("steel").optional();
        let steel = steel.and_then(|table| table.map(read_steel).transpose());
        let target = root.table("target").optional();
        let target = target.and_then(|table| table.map(|table| target::read(table, rectangle)).transpose());
        let markers = read_all(&mut root, "marker", |table, names| read_marker(table, names, rectangle));
        let lines = read_all(&mut root, "reference_line", |table, names| read_line(table, names, rectangle));
        let known = lines.as_deref().map_err(|reported| *reported);
        let templates = read_all(&mut root, "template", |table, names| template::read(table, names, known));
        let supports = read_all(&mut root, "support", |table, _| read_support(table, rectangle));
        let stations = read_all(&mut root, "station", |table, names| read_station(table, names, rectangle));
        let trim_lines =
            read_all(&mut root, "trim_line", |table, names| read_trim_line(table, names, rectangle));
        root.finish();
        Ok(Self {
            plate: plate?,
            steel: steel?,
            target: target?,
            markers: markers?.into_iter().collect::<Result<_, _>>()?,
            reference_lines: lines?.into_iter().map(|line| line.line).collect::<Result<_, _>>()?,
            supports: supports?.into_iter().collect::<Result<_, _>>()?,
            templates: templates?.into_iter().collect::<Result<_, _>>()?,
            stations: stations?.into_iter().collect::<Result<_, _>>()?,
            trim_lines: trim_lines?.into_iter().collect::<Result<_, _>>()?,
        })
    }
}

/// Reads every element of an array of tables with `read`, which also receives the names used so far.
fn read_all<'d, T>(
    root: &mut TomlTable<'d>,
    key: &str,
    mut read: impl FnMut(TomlTable<'d>, &mut Names) -> T,
) -> Result<Vec<T>, Reported> {
    let mut names = Names::default();
    let mut all = Vec::new();
    for table in root.tables(key)? {
        names.number += 1;
        all.push(read(table, &mut names));
    }
    Ok(all)
}

/// Reads `[steel]`.
fn read_steel(mut table: TomlTable<'_>) -> Result<Steel, Reported> {
    let grade = table.name("grade").optional();
    let yield_mpa = table.number("yield_mpa").in_range(YIELD_MPA).required();
    let heat = table.name("heat").optional();
    table.finish();
    Ok(Steel { grade: grade?, yield_strength: 1e6 * yield_mpa?, heat: heat? })
}

/// Reads `[plate]`; sets `rectangle` if both sides are valid.
fn read_plate(mut table: TomlTable<'_>, rectangle: &mut Option<Rectangle>) -> Result<Plate, Reported> {
    let id = table.name("id").required();
    let width = table.number("width_mm").in_range(SIDE_MM).required();
    let height = table.number("height_mm").in_range(SIDE_MM).required();
    let thickness = table.number("thickness_mm").in_range(THICKNESS_MM).located().required();
    let supports = table.name("supports").optional();
    let edges = EdgeKeys::read(&mut table);
    let document = table.document();
    table.finish();

    if let (Ok(width), Ok(height)) = (width, height) {
        *rectangle = Some(Rectangle { width: metres(width), height: metres(height) });
    }
    let edges = edges.check(document, thickness.as_ref().ok().map(|thickness| thickness.value));
    let (width, height, thickness) = (width?, height?, thickness?);
    if thickness.value > width.min(height) / 4.0 {
        let message = format!("found {}, no plate of {width} x {height} mm is that thick", thickness.value);
        return Err(document.fault(&thickness.place, message));
    }
    let edges = edges?;
    Ok(Plate {
        id: id?,
        width: metres(width),
        height: metres(height),
        thickness: metres(thickness.value),
        supports: supports?,
        face_inset: metres(edges.face_inset),
        root_face: metres(edges.root_face),
    })
}

fn read_marker(
    mut table: TomlTable<'_>,
    names: &mut Names,
    plate: Option<Rectangle>,
) -> Result<Marker, Reported> {
    let name = names.take(&mut table);
    let at = place::point(&mut table, "at_mm", plate);
    table.finish();
    Ok(Marker { name: name?, at: at? })
}

fn read_support(mut table: TomlTable<'_>, plate: Option<Rectangle>) -> Result<Support, Reported> {
    let at = place::point(&mut table, "at_mm", plate);
    table.finish();
    Ok(Support { at: at? })
}

fn read_trim_line(
    mut table: TomlTable<'_>,
    names: &mut Names,
    plate: Option<Rectangle>,
) -> Result<TrimLine, Reported> {
    let name = names.take(&mut table);
    let points = place::points(&mut table, "points_mm", plate);
    table.finish();
    Ok(TrimLine { name: name?, points: points? })
}

fn read_line(mut table: TomlTable<'_>, names: &mut Names, plate: Option<Rectangle>) -> NamedLine {
    let name = names.take(&mut table);
    let from = place::point(&mut table, "from_mm", plate);
    let to = place::point(&mut table, "to_mm", plate);
    let (document, place) = (table.document(), table.place().clone());
    table.finish();
    let ends = from.and_then(|from| {
        let to = to?;
        if from == to {
            return Err(document.fault(&place, "from_mm and to_mm are the same point; a line needs two"));
        }
        Ok((from, to))
    });
    let line = ends.and_then(|(from, to)| Ok(ReferenceLine { name: name.clone()?, from, to }));
    NamedLine { name, line }
}

fn read_station(
    mut table: TomlTable<'_>,
    names: &mut Names,
    plate: Option<Rectangle>,
) -> Result<Station, Reported> {
    let name = names.take(&mut table);
    let at = place::point(&mut table, "at_mm", plate);
    let quantity = table.choice(
        "quantity",
        &[
            ("deviation", Quantity::Deviation),
            ("gap", Quantity::Gap),
            ("curvature_deficit", Quantity::CurvatureDeficit),
        ],
    );
    let quantity = quantity.required();
    table.finish();
    Ok(Station { name: name?, at: at?, quantity: quantity? })
}
