//! Excerpt of a result document for a message: verdicts, figures and uncertainties, without surfaces, grids and
//! profiles.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use serde_json::{Map, Value as Json, json};

/// Members of `platen.result/1` that are copied without change.
const TAKEN: [&str; 12] = [
    "software",
    "plate",
    "says",
    "supports",
    "calibration",
    "scan",
    "corners_seen",
    "next",
    "quality",
    "plugins",
    "timings_ms",
    "clock",
];
/// Members of a template that are copied; its profile is not.
const OF_TEMPLATE: [&str; 10] = [
    "name",
    "seat",
    "rocks",
    "max_gap_mm",
    "uncertainty_mm",
    "max_gap_at_mm",
    "limit_mm",
    "sense",
    "verdict",
    "chord_mm",
];

/// Parts of a result document.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct DocumentExcerpt {
    /// SHA-256 of the whole document, hexadecimal.
    pub sha256: String,
    /// Each template with the name of its line.
    pub templates: Vec<Json>,
    /// Bends that the stroke made, as `curvature` found them.
    pub bends: Vec<Json>,
    /// Members of `platen.result/1`, as they stand there.
    #[serde(flatten)]
    pub taken: Map<String, Json>,
}

impl DocumentExcerpt {
    /// Reads a document; `None` where there is none or it is damaged.
    ///
    /// Nine tenths of a document are surface, grid and profiles. Members that are not copied are skipped without
    /// parsing; for speed with a backlog only (`tests/peers/forward`, the changes a second).
    pub(super) fn load(path: &Path) -> Option<Self> {
        let bytes = std::fs::read(path).ok()?;
        let document: Members<'_> = serde_json::from_slice(&bytes).ok()?;
        let lines: Vec<Line<'_>> = read(&document, "reference_lines").unwrap_or_default();
        let comparisons: Vec<Json> = read(&document, "comparisons").unwrap_or_default();
        let template = |line: &Json, members: &Members<'_>| {
            let mut kept = taken(members, &OF_TEMPLATE);
            kept.insert("line".into(), line.clone());
            Json::Object(kept)
        };
        let templates =
            lines.iter().flat_map(|line| line.templates.iter().map(|it| template(&line.name, it)));
        Some(Self {
            sha256: super::sha256(&bytes),
            templates: templates.collect(),
            bends: comparisons.iter().flat_map(bends_of).collect(),
            taken: taken(&document, &TAKEN),
        })
    }
}

/// Members of a JSON object with their values not yet parsed.
type Members<'a> = BTreeMap<String, &'a RawValue>;

/// Reference line of a document.
#[derive(Deserialize)]
struct Line<'a> {
    #[serde(default)]
    name: Json,
    #[serde(borrow, default)]
    templates: Vec<Members<'a>>,
}

/// Returns the value of a member; `None` where there is none or it has another type.
fn read<'a, T: Deserialize<'a>>(of: &Members<'a>, name: &str) -> Option<T> {
    serde_json::from_str(of.get(name)?.get()).ok()
}

fn taken(of: &Members<'_>, names: &[&str]) -> Map<String, Json> {
    let found = names.iter().filter_map(|name| Some(((*name).to_owned(), read(of, name)?)));
    found.collect()
}

/// Returns the bends among a comparison's figures, `bend.N.angle` with its place, `.direction`, `.length` and `.width`.
fn bends_of(comparison: &Json) -> Vec<Json> {
    let figures: Vec<&Json> = comparison["figures"].as_array().into_iter().flatten().collect();
    let named = |name: String| figures.iter().find(|figure| figure["name"] == *name);
    let bend = |n: usize| {
        let angle = named(format!("bend.{n}.angle"))?;
        let of = |part: &str, key: &str| named(format!("bend.{n}.{part}")).map(|figure| figure[key].clone());
        Some(json!({
            "at_mm": angle["at_mm"],
            "angle_deg": angle["value_deg"],
            "uncertainty_deg": angle["uncertainty_deg"],
            "direction_deg": of("direction", "value_deg"),
            "length_mm": of("length", "value_mm"),
            "width_mm": of("width", "value_mm"),
        }))
    };
    (1..).map_while(bend).collect()
}
