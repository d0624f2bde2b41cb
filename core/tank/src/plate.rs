//! Development of a zone to its plate: blank, trim lines, template lines and check figures.

use platen_model::{Facing, Target, TrimLine};
use serde::Serialize;

use crate::{DENSITY, Membrane, Mill, Rule, Tank, Zone};

/// Number of steps of a trim line along the meridian and across it.
const STEPS: [usize; 2] = [12, 6];
/// Number of rounds in which the blank's size and the material's displacement are computed in turn; they agree to 0.1
/// mm after two.
const SIZES: usize = 3;
/// Distance of the outer templates from the trim lines, metres.
const INSET: f64 = 0.1;
/// Share of the narrowest half width at which the outer templates along the meridian lie.
const OUTER: f64 = 0.8;

/// A length to be measured on the formed plate, or a figure of its forming.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// Name of the length or figure.
    pub what: String,
    /// Value, in the unit of its name.
    pub value: f64,
    /// Unit: `mm`, `%`, `deg`.
    pub unit: &'static str,
}

/// Plate of a zone.
#[derive(Debug, Clone, PartialEq)]
pub struct Plate {
    /// Blank: extent along u and v.
    pub blank: [f64; 2],
    /// Allowance on each edge.
    pub allowance: f64,
    /// Mass of the blank, kg.
    pub mass: f64,
    /// Target, with its radii on the mid-surface.
    pub target: Target,
    /// Outline of the finished plate on the blank: the seams at small and large u, the ends at small and large v.
    pub trim: [TrimLine; 4],
    /// Lines for templates, each with its name.
    pub lines: Vec<(String, [[f64; 2]; 2])>,
    /// Figures to check the plate by.
    pub checks: Vec<Check>,
}

impl Plate {
    /// Develops the plates of a zone.
    #[must_use]
    pub fn of(tank: &Tank, zone: &Zone) -> Self {
        Self::with(tank, zone, zone.plates)
    }

    fn with(tank: &Tank, zone: &Zone, plates: u32) -> Self {
        let surface = &zone.surface;
        let at = |t: f64, side: f64| surface.develop(t, side * surface.half_width(t, plates, tank.root_gap));
        let share = |k: usize, n: usize| k as f64 / n as f64;
        let seam = |side: f64| (0..=STEPS[0]).map(|k| at(share(k, STEPS[0]), side)).collect::<Vec<_>>();
        let end = |t: f64| (0..=STEPS[1]).map(|k| at(t, 2.0 * share(k, STEPS[1]) - 1.0)).collect::<Vec<_>>();
        // Outline on the formed plate, with the widest place of the seams.
        let formed = [seam(-1.0), seam(1.0), end(0.0), end(1.0)];
        let widest = [-1.0, 1.0].map(|side| at(widest(zone), side));
        let middle = extents(formed.iter().flatten().chain(&widest)).map(|[low, high]| 0.5 * (low + high));
        let from_middle = |point: &[f64; 2]| [point[0] - middle[0], point[1] - middle[1]];

        // Outline on the blank: its size depends on the displacement of the material, which depends on the size.
        let mut outline = formed.clone().map(|line| line.iter().map(from_middle).collect::<Vec<_>>());
        let mut widest = widest.map(|point| from_middle(&point));
        let mut box_ = extents(outline.iter().flatten().chain(&widest));
        let size = |[u, v]: [[f64; 2]; 2]| [u, v].map(|[low, high]| high - low + 2.0 * tank.allowance);
        if surface.is_doubly_curved() {
            for _ in 0..SIZES {
                let membrane = Membrane::new(size(box_), surface.gaussian_curvature());
                let off = box_.map(|[low, high]| 0.5 * (low + high));
                // The membrane's middle is that of the blank.
                let on_blank = |point: &[f64; 2]| {
                    let [x, y] = from_middle(point);
                    let [x, y] = membrane.blank([x - off[0], y - off[1]]);
                    [x + off[0], y + off[1]]
                };
                outline = formed.clone().map(|line| line.iter().map(on_blank).collect());
                widest = [-1.0, 1.0].map(|side| on_blank(&at(self::widest(zone), side)));
                box_ = extents(outline.iter().flatten().chain(&widest));
            }
        }
        let origin = box_.map(|[low, _]| low - tank.allowance);
        for point in outline.iter_mut().flatten() {
            *point = [point[0] - origin[0], point[1] - origin[1]];
        }
        let blank = size(box_);
        let mut names = ["seam, u small", "seam, u large", "end, v small", "end, v large"].into_iter();
        let trim = outline.map(|points| TrimLine { name: names.next().unwrap_or_default().into(), points });
        let from = middle[1] + origin[1];
        Self {
            blank,
            allowance: tank.allowance,
            mass: blank[0] * blank[1] * zone.thickness * DENSITY,
            target: Target {
                shape: surface.target(from, from + blank[1]),
                radius_of: platen_model::RadiusOf::Mid,
                scanned_face: tank.scanned_face,
            },
            lines: lines(&trim, surface.is_doubly_curved()),
            trim,
            checks: checks(tank, zone, plates, blank),
        }
    }

    /// Returns whether the mill has blanks of this size.
    #[must_use]
    pub fn is_of(&self, mill: &Mill) -> bool {
        let [a, b] = self.blank;
        a.min(b) <= mill.width && a.max(b) <= mill.length && mill.mass.is_none_or(|most| self.mass <= most)
    }

    /// Returns the least number of plates around the ring whose blanks the mill can supply; `None` where no number is
    /// sufficient since the plates are too long.
    #[must_use]
    pub fn least(tank: &Tank, zone: &Zone, mill: &Mill) -> Option<u32> {
        (zone.plates..=10 * zone.plates).find(|plates| Self::with(tank, zone, *plates).is_of(mill))
    }

    /// Returns the names of the lines that are long enough for a rule's board, and those of the lines that are not.
    #[must_use]
    pub fn templates(&self, rule: &Rule) -> (Vec<&str>, Vec<&str>) {
        let chord = rule.limit.map_or(f64::INFINITY, |[chord, _]| chord);
        let (mut long, mut short) = (Vec::new(), Vec::new());
        for (name, [from, to]) in &self.lines {
            let length = (to[0] - from[0]).hypot(to[1] - from[1]);
            if length >= chord { &mut long } else { &mut short }.push(name.as_str());
        }
        (long, short)
    }
}

/// Returns the share of the meridian at which the ring is widest: the equator of a sphere, where the zone has it.
fn widest(zone: &Zone) -> f64 {
    match zone.surface {
        crate::Revolution::Torus { from, to, .. } => {
            ((std::f64::consts::FRAC_PI_2 - from) / (to - from)).clamp(0.0, 1.0)
        }
        _ => 1.0,
    }
}

/// Returns the least and the largest coordinate along each axis.
fn extents<'a>(points: impl Iterator<Item = &'a [f64; 2]>) -> [[f64; 2]; 2] {
    let mut extents = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for point in points {
        for (extent, at) in extents.iter_mut().zip(point) {
            *extent = [extent[0].min(*at), extent[1].max(*at)];
        }
    }
    extents
}

/// Returns lines across the meridian near both ends and in the middle and, on a doubly curved plate, along it.
fn lines(trim: &[TrimLine; 4], both: bool) -> Vec<(String, [[f64; 2]; 2])> {
    let [left, right, low, high] = trim.each_ref().map(|line| &line.points[..]);
    let most =
        |points: &[[f64; 2]], axis: usize| points.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
    let least =
        |points: &[[f64; 2]], axis: usize| points.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
    let (bottom, top) = (most(low, 1) + INSET, least(high, 1) - INSET);
    let across = [("low", bottom), ("middle", 0.5 * (bottom + top)), ("high", top)];
    let across = across.map(|(name, v)| (name.to_owned(), [[cut(left, 1, v), v], [cut(right, 1, v), v]]));
    let mut lines = across.to_vec();
    if both {
        let middle = 0.5 * (most(left, 0) + least(right, 0));
        let half = OUTER * (least(right, 0) - middle);
        let along = [("left", middle - half), ("centre", middle), ("right", middle + half)];
        lines.extend(along.map(|(name, u)| (name.to_owned(), [[u, cut(low, 0, u)], [u, cut(high, 0, u)]])));
    }
    lines
}

/// Returns the other coordinate of a polyline where the coordinate `axis` is `at`.
fn cut(line: &[[f64; 2]], axis: usize, at: f64) -> f64 {
    let spans = line.windows(2);
    let holds = |pair: &&[[f64; 2]]| (pair[0][axis] - at) * (pair[1][axis] - at) <= 0.0;
    let pair = spans.clone().find(holds).or(spans.last());
    pair.map_or(0.0, |pair| {
        let [a, b] = [pair[0], pair[1]];
        let share = (at - a[axis]) / (b[axis] - a[axis]);
        a[1 - axis] + share * (b[1 - axis] - a[1 - axis])
    })
}

/// Returns chords of the finished plate on its scanned face and the figures of its forming.
fn checks(tank: &Tank, zone: &Zone, plates: u32, blank: [f64; 2]) -> Vec<Check> {
    let surface = &zone.surface;
    let off = 0.5 * zone.thickness * if tank.scanned_face == Facing::Outside { 1.0 } else { -1.0 };
    let corner =
        |t: f64, side: f64| surface.point(t, side * surface.half_width(t, plates, tank.root_gap), off);
    let chord = |a: [f64; 3], b: [f64; 3]| {
        let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
        1e3 * square.sqrt()
    };
    let mm = |what: &str, value: f64| Check { what: what.into(), value, unit: "mm" };
    let mut checks = vec![
        mm("chord across, v small", chord(corner(0.0, -1.0), corner(0.0, 1.0))),
        mm("chord across, v large", chord(corner(1.0, -1.0), corner(1.0, 1.0))),
        mm("chord along a seam", chord(corner(0.0, 1.0), corner(1.0, 1.0))),
        mm("diagonal", chord(corner(0.0, -1.0), corner(1.0, 1.0))),
        mm("mid-surface radius across, middle", 1e3 * surface.cross_radius(0.5)),
    ];
    // Strain of the outer fibre, from flat: ASME VIII-1, UCS-79, as design sheets quote it.
    let share = if surface.is_doubly_curved() { 75.0 } else { 50.0 };
    let tightest = match surface {
        crate::Revolution::Torus { radius, .. } => radius.min(surface.cross_radius(0.5)),
        crate::Revolution::Cone { .. } => surface.cross_radius(0.0),
        crate::Revolution::Cylinder { radius, .. } => *radius,
    };
    checks.push(Check {
        what: "cold forming strain".into(),
        value: share * zone.thickness / tightest,
        unit: "%",
    });
    if surface.is_doubly_curved() {
        let membrane = Membrane::new(blank, surface.gaussian_curvature());
        let [u, v] = membrane.strain([0.0, 0.0]).map(|strain| 100.0 * strain);
        let percent = |what: &str, value: f64| Check { what: what.into(), value, unit: "%" };
        checks.extend([percent("membrane strain in the middle, along u", u), percent("the same along v", v)]);
    }
    checks
}
