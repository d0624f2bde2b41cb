//! Place of the next hit: the place where a template shows the largest gap that is still to be bent.
//!
//! A template of chord c is held at both ends. The gap in its middle is the missing curvature dk in its section,
//! weighted by the influence line of a simply supported beam:
//!
//! ```text
//! g(p) = c^2 / 8 * integral of w(x - p) dk(x) dx,    w(x) = (1 - |x| / (c / 2)) / (c / 2)  for |x| < c / 2
//! ```
//!
//! - The template is the shortest of the plate file. It lies along the direction in which the target bends. Across that
//!   direction the mean has the same weights over the same length, or over the plate where it is shorter.
//! - Curvature below the level of detection counts as zero, and so does the area beyond the plate. A narrow band
//!   therefore gives its own middle, wherever it lies.
//! - Unseen area takes the mean of the seen area beside it, which must have at least half of the weight. Area of
//!   uncertain curvature counts as unseen (`trusted` of `curvature`).
//!
//! Limits: the result is only a place. Neither the force nor the depth of a stroke can be derived from it.

use super::fields::find_field;
use serde::{Deserialize, Serialize};

use platen_model::units::{mm, mm_pair};
use platen_model::{Field, NodeState, Report, Template, Verdict};
use platen_plant::PlateFile;
use platen_shape::TargetSurface;

/// Field of the curvature that is missing to the target, 1/m.
pub const CURVATURE_DEFICIT: &str = "curvature_deficit";

/// Place of the next hit, or the reason why there is none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Next {
    /// Place.
    Place(NextPlace),
    /// No place.
    Nowhere {
        /// Reason.
        none: NoNext,
    },
}

/// Place where the largest gap is still to be bent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NextPlace {
    /// Its middle (u, v).
    pub at_mm: [f64; 2],
    /// Extent of the missing curvature around it along u and v: that of a uniform band with the same second moment, on
    /// the plate.
    pub extent_mm: [f64; 2],
    /// Gap that the missing curvature makes under the template.
    pub gap_mm: f64,
    /// Its expanded uncertainty (95 %), equal to that of the template's own gap; null if the template was not laid
    /// there.
    pub uncertainty_mm: Option<f64>,
    /// Limit of the template.
    pub limit_mm: f64,
    /// Chord of the template.
    pub chord_mm: f64,
}

/// Reason why there is no place of the next hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoNext {
    /// The plate passed.
    Passed,
    /// No gap that is still to be bent exceeds the limit of the template and its uncertainty.
    NothingStandsOut,
    /// The largest gap is where the plate is bent too far: it must be turned over, or pressed back.
    BentTooFar,
    /// No target, no template, or no comparison with the curvature of the target.
    NoTarget,
    /// No gap exceeds the limit where the curvature is known, but in a part of the plate less than half of it is known:
    /// it was not seen or is too uncertain. With the range error that is assumed for an uncalibrated scanner, this is
    /// the case everywhere.
    NotEnoughSeen,
}

/// Nodes from one candidate for the place to the next, along u and v.
const STRIDE: usize = 2;
/// Gaps that differ by less than this share count as equal; then the place nearest to the middle of the plate is taken.
const EQUAL: f64 = 1e-3;

impl Next {
    /// Returns the place, if there is one.
    #[must_use]
    pub fn place(&self) -> Option<&NextPlace> {
        match self {
            Self::Place(place) => Some(place),
            Self::Nowhere { .. } => None,
        }
    }

    /// Describes place or reason in one sentence.
    #[must_use]
    pub fn says(&self) -> String {
        let none = match self {
            Self::Place(place) => return place.says(),
            Self::Nowhere { none } => none,
        };
        match none {
            NoNext::Passed => "no further hit: the plate passed",
            NoNext::NothingStandsOut => "no place stands out for the next hit",
            NoNext::BentTooFar => "no place to press: the plate is bent too far; turn the plate",
            NoNext::NoTarget => {
                "no place of a next hit is known: the plate file has no target or no template, or the plant no comparison `curvature`"
            }
            NoNext::NotEnoughSeen => {
                "no place of a next hit is known: too little of the plate was seen, or its curvature is too uncertain; calibrate the scanner"
            }
        }
        .to_owned()
    }

    /// Finds the place in the reports on a plate.
    pub(super) fn new(reports: &[&Report], plate: &PlateFile, verdict: Verdict) -> Self {
        let found = if verdict == Verdict::Pass { Err(NoNext::Passed) } else { find(reports, plate) };
        found.map_or_else(|none| Self::Nowhere { none }, Self::Place)
    }
}

impl NextPlace {
    fn says(&self) -> String {
        let [u, v] = self.at_mm;
        let gap = crate::picture::Units::Millimetre.with_uncertainty(self.gap_mm, self.uncertainty_mm);
        format!(
            "next hit around u {u:.0}, v {v:.0} mm: {gap} mm are missing there under a template of {:.0} mm, limit {:.1} mm",
            self.chord_mm, self.limit_mm
        )
    }
}

fn find(reports: &[&Report], plate: &PlateFile) -> Result<NextPlace, NoNext> {
    let field = find_field(reports, "curvature", CURVATURE_DEFICIT, 1).ok_or(NoNext::NoTarget)?;
    let shortest = plate.templates.iter().min_by(|a, b| a.chord.total_cmp(&b.chord));
    let template = shortest.ok_or(NoNext::NoTarget)?;
    let target = plate.target.as_ref().ok_or(NoNext::NoTarget)?;
    let target = TargetSurface::of_plate(target, &plate.plate).map_err(|_| NoNext::NoTarget)?;
    let size = [plate.plate.width, plate.plate.height];
    // Along u where the target has no preferred direction.
    let along = target.bending(0.5 * size[0], 0.5 * size[1]).unwrap_or([1.0, 0.0]);
    let laid = reports.iter().flat_map(|report| &report.findings.templates);
    let uncertainty = laid.filter(|t| t.name == template.name).map(|t| t.uncertainty).max_by(f64::total_cmp);
    Gaps::new(field, size, along, template.chord).next(template, uncertainty)
}

/// Gaps caused by a field of missing curvature under a template laid anywhere on the plate.
struct Gaps<'a> {
    field: &'a Field,
    /// Distance of the nodes along u and v, metres.
    step: [f64; 2],
    size: [f64; 2],
    weights: Weights,
    chord: f64,
}

/// Weights at the nodes around a place: triangles along the direction of bending and across it.
struct Weights {
    /// Nodes to each side, along u and v.
    reach: [usize; 2],
    /// v outer, u inner.
    values: Vec<f64>,
    /// Sum of the weights for a place whose surroundings lie entirely on the plate.
    whole: f64,
}

/// Missing curvature around a place.
struct Around {
    node: usize,
    at: [f64; 2],
    /// Gap under the template, metres; positive where the plate must bend more.
    gap: f64,
}

impl Weights {
    fn new(step: [f64; 2], size: [f64; 2], along: [f64; 2], chord: f64) -> Self {
        let across = [-along[1], along[0]];
        let extent = (size[0] * across[0]).abs() + (size[1] * across[1]).abs();
        let half = [0.5 * chord, 0.5 * chord.min(extent)];
        let project = |way: [f64; 2], x: [f64; 2]| (way[0] * x[0] + way[1] * x[1]).abs();
        let reach = [0, 1].map(|i| {
            let far = half[0] * along[i].abs() + half[1] * across[i].abs();
            (far / step[i]).ceil() as usize
        });
        let offset = |k: usize, i: usize| (k as f64 - reach[i] as f64) * step[i];
        let [wide, high] = reach.map(|n| 2 * n + 1);
        let weight = |k: usize| {
            let x = [offset(k % wide, 0), offset(k / wide, 1)];
            (1.0 - project(along, x) / half[0]).max(0.0) * (1.0 - project(across, x) / half[1]).max(0.0)
        };
        let whole = half[0] * half[1] / (step[0] * step[1]);
        Self { reach, values: (0..wide * high).map(weight).collect(), whole }
    }
}

impl<'a> Gaps<'a> {
    fn new(field: &'a Field, size: [f64; 2], along: [f64; 2], chord: f64) -> Self {
        let step = [0, 1].map(|i| size[i] / (field.nodes[i].max(2) - 1) as f64);
        Self { field, step, size, weights: Weights::new(step, size, along, chord), chord }
    }

    /// Returns the place of the largest gap, unless the plate is bent too far there or the gap is within limit and
    /// uncertainty.
    fn next(&self, template: &Template, uncertainty: Option<f64>) -> Result<NextPlace, NoNext> {
        let (mut more, mut too_far): (Vec<Around>, f64) = (Vec::new(), 0.0);
        let mut all_seen = true;
        for node in self.candidates() {
            let Some(around) = self.around(node) else {
                all_seen = false;
                continue;
            };
            too_far = too_far.max(-around.gap);
            // Only a node that itself lacks curvature can be the place.
            if self.field.state[node] == NodeState::Seen && self.field.values[node] > 0.0 {
                more.push(around);
            }
        }
        let least = template.limit.max(uncertainty.unwrap_or(0.0));
        let largest = more.iter().map(|around| around.gap).fold(0.0, f64::max);
        let off_middle =
            |around: &Around| (around.at[0] - 0.5 * self.size[0]).hypot(around.at[1] - 0.5 * self.size[1]);
        let equal = more.iter().filter(|around| around.gap >= (1.0 - EQUAL) * largest);
        let best = equal.min_by(|a, b| off_middle(a).total_cmp(&off_middle(b)));
        match best {
            _ if too_far > least.max(largest) => Err(NoNext::BentTooFar),
            Some(best) if largest > least => Ok(NextPlace {
                at_mm: mm_pair(best.at),
                extent_mm: mm_pair(self.extent(best)),
                gap_mm: mm(best.gap),
                uncertainty_mm: uncertainty.map(mm),
                limit_mm: mm(template.limit),
                chord_mm: mm(self.chord),
            }),
            _ if all_seen => Err(NoNext::NothingStandsOut),
            _ => Err(NoNext::NotEnoughSeen),
        }
    }

    fn candidates(&self) -> impl Iterator<Item = usize> {
        let [n_u, n_v] = self.field.nodes;
        (0..n_v).step_by(STRIDE).flat_map(move |row| (0..n_u).step_by(STRIDE).map(move |i| row * n_u + i))
    }

    /// Returns the gap in the middle of the template at a node; `None` if less than half of its surroundings were seen.
    fn around(&self, node: usize) -> Option<Around> {
        let (mut plate, mut seen, mut sum) = (0.0, 0.0, 0.0);
        for (weight, other) in self.surroundings(node) {
            plate += weight;
            match self.field.state[other] {
                NodeState::Unseen => {}
                NodeState::Unchanged => seen += weight,
                NodeState::Seen => {
                    seen += weight;
                    sum += weight * self.field.values[other];
                }
            }
        }
        let mean = sum / seen * (plate / self.weights.whole);
        let gap = self.chord.powi(2) / 8.0 * mean;
        (2.0 * seen >= plate && seen > 0.0).then(|| Around { node, at: self.at(node), gap })
    }

    /// Returns the extents along u and v of a uniform band with the second moments of the missing curvature around a
    /// place.
    fn extent(&self, around: &Around) -> [f64; 2] {
        let (mut sum, mut moments) = (0.0, [0.0; 2]);
        for (weight, other) in self.surroundings(around.node) {
            if self.field.state[other] == NodeState::Seen {
                let missing = weight * self.field.values[other].max(0.0);
                let at = self.at(other);
                sum += missing;
                for i in [0, 1] {
                    moments[i] += missing * (at[i] - around.at[i]).powi(2);
                }
            }
        }
        [0, 1].map(|i| {
            let half = (3.0 * moments[i] / sum).sqrt().max(self.step[i]);
            2.0 * half.min(around.at[i]).min(self.size[i] - around.at[i])
        })
    }

    /// Returns the nodes around a node with their weights.
    fn surroundings(&self, node: usize) -> impl Iterator<Item = (f64, usize)> {
        let [n_u, n_v] = self.field.nodes;
        let Weights { reach, values, .. } = &self.weights;
        let (column, row) = (node % n_u, node / n_u);
        let span = |at: usize, i: usize, n: usize| at.saturating_sub(reach[i])..(at + reach[i] + 1).min(n);
        let (columns, rows) = (span(column, 0, n_u), span(row, 1, n_v));
        rows.flat_map(move |other_row| {
            let first = (other_row + reach[1] - row) * (2 * reach[0] + 1);
            columns
                .clone()
                .map(move |other| (values[first + other + reach[0] - column], other_row * n_u + other))
        })
    }

    fn at(&self, node: usize) -> [f64; 2] {
        let [n_u, n_v] = self.field.nodes;
        let along = |k: usize, n: usize, length: f64| length * k as f64 / (n.max(2) - 1) as f64;
        [along(node % n_u, n_u, self.size[0]), along(node / n_u, n_v, self.size[1])]
    }
}

#[cfg(test)]
mod tests;
