//! Bend lines of a target: parallel on a cylinder, through the developed apex on a cone.
//!
//! A line is identified by its coordinate x, metres: its distance from the plate's first corner across the lines, on a
//! cone measured along the arc through the middle of the plate. x grows with u, or with v where the lines run along u.

use platen_model::{Target, TargetShape, Task};
use platen_shape::TargetSurface;

/// Family of bend lines on the original rectangle.
#[derive(Debug, Clone, Copy)]
pub struct BendLines {
    family: Family,
    size: [f64; 2],
    /// Coordinate of the plate's first corner, before the shift that makes it 0.
    first: f64,
    length: f64,
}

#[derive(Debug, Clone, Copy)]
enum Family {
    /// Unit direction across the lines.
    Parallel([f64; 2]),
    /// Apex (u, v), distance from the apex to the middle of the plate, unit direction from the apex to the middle, and
    /// 1 when x grows with the angle from u towards v, else -1.
    Fan { apex: [f64; 2], slant: f64, to_middle: [f64; 2], way: f64 },
}

impl BendLines {
    /// Returns the lines of a task's target; `None` for a plane, a sphere and a torus.
    #[must_use]
    pub fn of_task(task: &Task) -> Option<Self> {
        let target = task.target.as_ref()?;
        let size = [task.width, task.height];
        let family = match target.shape {
            TargetShape::Cylinder { axis, .. } => Family::Parallel(onward([axis.sin(), -axis.cos()])),
            TargetShape::Cone { axis, radius_start, radius_end } => {
                fan(target, task, axis, radius_end - radius_start)?
            }
            TargetShape::Flat | TargetShape::Sphere { .. } | TargetShape::Torus { .. } => return None,
        };
        let mut lines = Self { family, size, first: 0.0, length: 0.0 };
        let [w, h] = size;
        let corners = [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]].map(|corner| lines.coordinate(corner));
        lines.first = corners.iter().copied().fold(f64::INFINITY, f64::min);
        lines.length = corners.iter().copied().fold(f64::NEG_INFINITY, f64::max) - lines.first;
        Some(lines)
    }

    /// Returns the largest coordinate; the smallest is 0.
    #[must_use]
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Returns the coordinate of the line through a place.
    #[must_use]
    pub fn coordinate(&self, at: [f64; 2]) -> f64 {
        let x = match self.family {
            Family::Parallel([a, b]) => a * at[0] + b * at[1],
            Family::Fan { apex, slant, to_middle, way } => {
                let [along, across] = polar(apex, to_middle, at);
                way * slant * across.atan2(along)
            }
        };
        x - self.first
    }

    /// Returns the distance of a place from the line x, positive towards larger x.
    #[must_use]
    pub fn distance(&self, x: f64, at: [f64; 2]) -> f64 {
        match self.family {
            Family::Parallel(_) => self.coordinate(at) - x,
            Family::Fan { apex, slant, to_middle, way } => {
                let [along, across] = polar(apex, to_middle, at);
                let (sin, cos) = (way * (x + self.first) / slant).sin_cos();
                way * (across * cos - along * sin)
            }
        }
    }

    /// Returns the unit direction of the line x.
    #[must_use]
    pub fn direction(&self, x: f64) -> [f64; 2] {
        match self.family {
            Family::Parallel([a, b]) => [-b, a],
            Family::Fan { slant, to_middle: [c, s], way, .. } => {
                let (sin, cos) = (way * (x + self.first) / slant).sin_cos();
                [c * cos - s * sin, s * cos + c * sin]
            }
        }
    }

    /// Returns the ends of the line x on the edges of the plate; `None` where it misses the plate.
    #[must_use]
    pub fn ends(&self, x: f64) -> Option<[[f64; 2]; 2]> {
        let direction = self.direction(x);
        let through = match self.family {
            Family::Parallel(across) => across.map(|c| c * (x + self.first)),
            Family::Fan { apex, .. } => apex,
        };
        let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
        for k in [0, 1] {
            // Parallel to a pair of edges within rounding: the line lies between both edges, or misses the plate.
            if direction[k].abs() < 1e-12 {
                if !(0.0..=self.size[k]).contains(&through[k]) {
                    return None;
                }
                continue;
            }
            let cut = [0.0, self.size[k]].map(|edge| (edge - through[k]) / direction[k]);
            from = from.max(cut[0].min(cut[1]));
            to = to.min(cut[0].max(cut[1]));
        }
        let at = |t: f64| [0, 1].map(|k| (through[k] + t * direction[k]).clamp(0.0, self.size[k]));
        (from <= to).then(|| [at(from), at(to)])
    }
}

/// Returns the direction or its opposite: the one along which u grows, or v for a direction along the v axis.
fn onward([a, b]: [f64; 2]) -> [f64; 2] {
    let sign = if a.abs() > 1e-9 { a.signum() } else { b.signum() };
    [sign * a, sign * b]
}

/// Returns the coordinates of a place along the middle line from the apex, and across it from u towards v.
fn polar(apex: [f64; 2], [c, s]: [f64; 2], at: [f64; 2]) -> [f64; 2] {
    let [x, y] = [at[0] - apex[0], at[1] - apex[1]];
    [c * x + s * y, c * y - s * x]
}

/// Returns the fan of a cone, from the radius of normal curvature in the middle and its change along the middle line.
fn fan(target: &Target, task: &Task, axis: f64, change: f64) -> Option<Family> {
    let [w, h] = [task.width, task.height];
    let (sin, cos) = axis.sin_cos();
    let growth = change / (w / cos.abs()).min(h / sin.abs());
    if growth.abs() < 1e-9 {
        return Some(Family::Parallel(onward([sin, -cos])));
    }
    let surface = TargetSurface::new(target, w, h, task.thickness).ok()?;
    let middle = [0.5 * w, 0.5 * h];
    let slant = 1.0 / (surface.curvature(middle[0], middle[1]).strongest().abs() * growth.abs());
    let to_middle = [growth.signum() * cos, growth.signum() * sin];
    let apex = [0, 1].map(|k| middle[k] - slant * to_middle[k]);
    let across = [-to_middle[1], to_middle[0]];
    let way = if onward(across) == across { 1.0 } else { -1.0 };
    Some(Family::Fan { apex, slant, to_middle, way })
}
