//! Reader of tank files.

use std::path::Path;

use platen_model::{Facing, RadiusOf, Steel};
use platen_plant::{Document, Error, Faults, Reported, TomlTable};

use crate::{Mill, Plate, Revolution, Rule, Tank, Zone};

/// Range of radii and lengths, millimetres.
const LENGTH_MM: std::ops::RangeInclusive<f64> = 100.0..=200_000.0;
/// Range of plate thickness, millimetres.
const THICKNESS_MM: std::ops::RangeInclusive<f64> = 1.0..=300.0;
/// Range of polar angles, degrees: at the pole itself a plate has no width.
const POLAR_DEG: std::ops::RangeInclusive<f64> = 5.0..=175.0;

/// Largest blank of a plate file.
const LARGEST: Mill = Mill { width: 20.0, length: 20.0, mass: None };

fn metres(mm: f64) -> f64 {
    1e-3 * mm
}

#[derive(Debug, Clone, Copy)]
enum Shape {
    Cylinder,
    Cone,
    Sphere,
    Torus,
}

const SHAPES: [(&str, Shape); 4] = [
    ("cylinder", Shape::Cylinder),
    ("cone", Shape::Cone),
    ("sphere", Shape::Sphere),
    ("torus", Shape::Torus),
];

impl Tank {
    /// Reads a tank file.
    ///
    /// # Errors
    /// [`Error::Unreadable`], or [`Error::Faulty`] with every fault of the file, including plates that the mill cannot
    /// roll.
    pub fn load(path: &Path) -> Result<Self, Error> {
        Ok(Self::take(Document::load(path)?)?)
    }

    /// Checks the text of a tank file; `file` is its name in messages.
    ///
    /// # Errors
    /// Every fault of the text.
    pub fn parse(file: &str, text: &str) -> Result<Self, Faults> {
        Self::take(Document::parse(file, text))
    }

    fn take(document: Document) -> Result<Self, Faults> {
        let tank = Self::read(document.root());
        document.finish(tank)
    }

    fn read(mut root: TomlTable<'_>) -> Result<Self, Reported> {
        let mut table = root.table("tank").required()?;
        let name = table.name("name").required();
        let radius_of =
            [("inside", RadiusOf::Inside), ("mid", RadiusOf::Mid), ("outside", RadiusOf::Outside)];
        let radius_of = table.choice("radius_of", &radius_of).or(RadiusOf::Inside);
        let scanned_face =
            table.choice("scanned_face", &[("inside", Facing::Inside), ("outside", Facing::Outside)]);
        let scanned_face = scanned_face.or(Facing::Inside);
        let root_gap = table.number("root_gap_mm").in_range(0.0..=50.0).map(metres).or(0.0);
        let allowance = table.number("allowance_mm").in_range(0.0..=500.0).map(metres).or(0.0);
        let supports = table.name("supports").optional();
        table.finish();
        let mill = root.table("mill").optional().and_then(|table| table.map(read_mill).transpose());
        let steel = root.table("steel").optional().and_then(|table| table.map(read_steel).transpose());
        let rules = root.tables("rule")?.into_iter().map(read_rule).collect::<Result<Vec<_>, _>>();
        let (radius_of, rules) = (radius_of?, rules?);
        let tables = root.tables("zone")?;
        let document = root.document();
        if tables.is_empty() {
            return Err(document.fault(root.place(), "no [[zone]]: name the rings of plates"));
        }
        root.finish();
        let mut tank = Self {
            name: name?,
            radius_of,
            scanned_face: scanned_face?,
            root_gap: root_gap?,
            allowance: allowance?,
            supports: supports?,
            steel: steel?,
            mill: mill?,
            rules,
            zones: Vec::new(),
        };
        let zones: Vec<_> = tables.into_iter().map(|table| read_zone(table, &mut tank)).collect();
        zones.into_iter().collect::<Result<Vec<()>, _>>()?;
        Ok(tank)
    }
}

fn read_mill(mut table: TomlTable<'_>) -> Result<Mill, Reported> {
    let width = table.number("width_mm").in_range(LENGTH_MM).map(metres).required();
    let length = table.number("length_mm").in_range(LENGTH_MM).map(metres).required();
    let mass = table.number("mass_kg").above(0.0).optional();
    table.finish();
    Ok(Mill { width: width?, length: length?, mass: mass? })
}

fn read_steel(mut table: TomlTable<'_>) -> Result<Steel, Reported> {
    let grade = table.name("grade").optional();
    let yield_mpa = table.number("yield_mpa").in_range(100.0..=2000.0).required();
    table.finish();
    Ok(Steel { grade: grade?, yield_strength: 1e6 * yield_mpa?, heat: None })
}

fn read_rule(mut table: TomlTable<'_>) -> Result<Rule, Reported> {
    let name = table.name("name").required();
    let chord = table.number("chord_mm").in_range(LENGTH_MM).map(metres).optional();
    let limit = table.number("limit_mm").above(0.0).map(metres).optional();
    let clause = table.name("clause").required();
    let edition = table.name("edition").optional();
    let typed_by = table.name("typed_by").optional();
    let (document, place) = (table.document(), table.place().clone());
    table.finish();
    let limit = match (chord?, limit?) {
        (Some(chord), Some(limit)) => Some([chord, limit]),
        (None, None) => None,
        _ => {
            return Err(
                document.fault(&place, "needs both chord_mm and limit_mm, or neither as an empty slot")
            );
        }
    };
    Ok(Rule { name: name?, limit, clause: clause?, edition: edition?, typed_by: typed_by? })
}

/// Reads a zone into the tank. A zone for which the mill has no blanks is a fault, reported with the number of plates
/// that fits.
fn read_zone(mut table: TomlTable<'_>, tank: &mut Tank) -> Result<(), Reported> {
    let name = table.name("name").required();
    let recipe = table.integer("recipe").in_range(1..=i64::from(u16::MAX)).required();
    let thickness = table.number("thickness_mm").in_range(THICKNESS_MM).map(metres).required();
    let plates = table.integer("plates").in_range(2..=1000).required();
    let rules: Vec<(&str, usize)> =
        tank.rules.iter().enumerate().map(|(k, rule)| (rule.name.as_str(), k)).collect();
    let rule = table.choice("rule", &rules).optional();
    let shape = table.choice("shape", &SHAPES).required();
    // Half a thickness from the given surface to the middle.
    let half = thickness.map(|t| match tank.radius_of {
        RadiusOf::Inside => 0.5 * t,
        RadiusOf::Mid => 0.0,
        RadiusOf::Outside => -0.5 * t,
    });
    let surface = shape.and_then(|shape| read_surface(shape, &mut table, half.unwrap_or(0.0)));
    let (document, place) = (table.document(), table.place().clone());
    if shape.is_ok() {
        table.finish();
    }
    let zone = Zone {
        name: name?,
        recipe: u16::try_from(recipe?).unwrap_or(u16::MAX),
        surface: surface?,
        thickness: thickness?,
        plates: u32::try_from(plates?).unwrap_or(u32::MAX),
        rule: rule?,
    };
    let fault = |message: String| Err(document.fault(&place, message));
    if let Some(other) =
        tank.zones.iter().find(|other| other.recipe == zone.recipe || other.name == zone.name)
    {
        return fault(format!("name and recipe must differ from those of zone {:?}", other.name));
    }
    let (mill, whose) = tank.mill.map_or((LARGEST, "beyond 20 m"), |mill| (mill, "which [mill] has not"));
    let plate = Plate::of(tank, &zone);
    if !plate.is_of(&mill) {
        let [width, height] = plate.blank.map(|side| 1e3 * side);
        let what = format!(
            "{} plates need blanks of {width:.0} x {height:.0} mm, {:.0} kg, {whose}",
            zone.plates, plate.mass
        );
        return fault(match Plate::least(tank, &zone, &mill) {
            Some(least) => format!("{what}; {least} plates or more fit"),
            None => format!("{what}; no number of plates fits: make the zone shorter"),
        });
    }
    tank.zones.push(zone);
    Ok(())
}

fn read_surface(shape: Shape, table: &mut TomlTable<'_>, half: f64) -> Result<Revolution, Reported> {
    let mut length = |key| table.number(key).in_range(LENGTH_MM).map(metres).required();
    match shape {
        Shape::Cylinder => {
            let (radius, height) = (length("radius_mm"), length("height_mm"));
            Ok(Revolution::Cylinder { radius: radius? + half, height: height? })
        }
        Shape::Cone => {
            let (from, to, slant) = (length("radius_start_mm"), length("radius_end_mm"), length("slant_mm"));
            let (document, place) = (table.document(), table.place().clone());
            let (from, to, slant) = (from?, to?, slant?);
            if from >= to || to - from >= slant {
                let message = "radius_end_mm must be above radius_start_mm, by less than slant_mm";
                return Err(document.fault(&place, message));
            }
            // Component of half a thickness along the normal that points away from the axis.
            let out = half * (1.0 - ((to - from) / slant).powi(2)).sqrt();
            Ok(Revolution::Cone { from: from + out, to: to + out, slant })
        }
        Shape::Sphere | Shape::Torus => {
            let radius = length("radius_mm");
            let centre = if matches!(shape, Shape::Torus) { length("centre_radius_mm") } else { Ok(0.0) };
            let mut polar = |key| table.number(key).in_range(POLAR_DEG).map(f64::to_radians).required();
            let (from, to) = (polar("from_deg"), polar("to_deg"));
            let (document, place) = (table.document(), table.place().clone());
            let (from, to) = (from?, to?);
            if to <= from {
                return Err(document.fault(&place, "to_deg must be above from_deg; both count from the top"));
            }
            Ok(Revolution::Torus { radius: radius? + half, centre: centre?, from, to })
        }
    }
}
