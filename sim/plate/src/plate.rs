//! Geometry prepared from one state of a plate: surface, derivatives, curvature and material map.
//!
//! The mid-surface is a [`SweptSurface`] or a [`Cone`]; faces are its parallel surfaces at plus and minus half the
//! thickness.

use crate::bevel::{Strip, strips};
use crate::cone::Cone;
use crate::cutting_error::CuttingError;
use crate::material::MaterialMap;
use crate::profile::Profile;
use crate::shape::{band_profile, curvature, step_profile};
use crate::swept_surface::SweptSurface;
use crate::{Jet, PlateError, PlateState, Shape, Vec3};
use nalgebra::Isometry3;

/// Side face of a plate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// v = 0, runs along u.
    Bottom,
    /// u = width, runs along v.
    Right,
    /// v = height, runs along u.
    Top,
    /// u = 0, runs along v.
    Left,
}

impl Side {
    /// All four sides, in the order of the outline.
    pub const ALL: [Self; 4] = [Self::Bottom, Self::Right, Self::Top, Self::Left];
}

/// Curvature along the material lines, 1/m, positive when the centre lies above the plate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curvature {
    /// Normal curvature of the line v = constant.
    pub kappa_u: f64,
    /// Normal curvature of the line u = constant.
    pub kappa_v: f64,
    /// Twist: second fundamental form of the two unit tangents.
    pub kappa_uv: f64,
    /// Mean curvature.
    pub mean: f64,
    /// Gaussian curvature, 1/m^2.
    pub gauss: f64,
}

#[derive(Debug, Clone)]
enum Surface {
    Swept(Box<SweptSurface>),
    Cone(Cone),
}

/// Bent plate: map from material points (u, v, h) to points in space; h is counted from the mid-surface along the upper
/// normal.
#[derive(Debug, Clone)]
pub struct Plate {
    cut: Option<CuttingError>,
    width: f64,
    height: f64,
    thickness: f64,
    strips: Vec<Strip>,
    markers: Vec<[f64; 2]>,
    surface: Surface,
    /// Unit direction of the second surface parameter (the axis) in (u, v).
    axis: [f64; 2],
    map: MaterialMap,
    scanner_from_plate: Isometry3<f64>,
}

impl Plate {
    /// Prepares the geometry of `state`; about 20 ms for shapes that are not developable.
    ///
    /// # Errors
    /// [`PlateError::Description`] with the key at fault.
    pub fn new(state: &PlateState) -> Result<Self, PlateError> {
        state.check()?;
        let blank = &state.blank;
        let (width, height) = (blank.width_mm * 1e-3, blank.height_mm * 1e-3);
        let (surface, axis) = surface(&state.shape, width, height)?;
        let mut plate = Self {
            width,
            height,
            thickness: blank.thickness_mm * 1e-3,
            strips: strips(blank),
            markers: blank.markers_mm.iter().map(|m| m.map(|c| c * 1e-3)).collect(),
            cut: CuttingError::new(blank),
            surface,
            axis,
            map: MaterialMap::identity(),
            scanner_from_plate: state.pose.scanner_from_plate(),
        };
        if let Surface::Swept(swept) = &plate.surface
            && !swept.is_developable()
        {
            plate.map = MaterialMap::least_energy(swept, axis, [width, height]);
        }
        Ok(plate)
    }

    /// Returns the ordered extent along u, metres.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Returns the ordered extent along v, metres.
    pub fn height(&self) -> f64 {
        self.height
    }

    /// Returns the thickness, metres.
    pub fn thickness(&self) -> f64 {
        self.thickness
    }

    /// Returns the strips of every side face: one, or two flanks and the root face between them.
    pub fn strips(&self) -> &[Strip] {
        &self.strips
    }

    /// Returns the distance of the faces' edges inside the mid-surface's edge, metres.
    pub fn face_inset(&self) -> f64 {
        self.strips.iter().map(|strip| strip.inset(strip.to)).fold(0.0, f64::max)
    }

    /// Returns the painted markers (u, v), metres.
    pub fn markers(&self) -> &[[f64; 2]] {
        &self.markers
    }

    /// Returns the transform from the local frame to the scanner frame.
    pub fn scanner_from_plate(&self) -> &Isometry3<f64> {
        &self.scanner_from_plate
    }

    /// Returns the mid-surface in the local frame with derivatives by (u, v).
    pub fn local_jet(&self, u: f64, v: f64) -> Jet {
        let (x, y) = (u - self.width / 2.0, v - self.height / 2.0);
        let [ax, ay] = self.axis;
        // s runs across the axis, r along it.
        let (mut s, mut r) = (ay * x - ax * y, ax * x + ay * y);
        let mut jacobian = [[ay, -ax], [ax, ay]];
        if let Some(shift) = self.map.shift(2.0 * x / self.width, 2.0 * y / self.height) {
            s += shift.value[0];
            r += shift.value[1];
            for (row, slope) in jacobian.iter_mut().zip(shift.slope) {
                row[0] += slope[0] * 2.0 / self.width;
                row[1] += slope[1] * 2.0 / self.height;
            }
        }
        let jet = match &self.surface {
            Surface::Swept(swept) => swept.jet(s, r),
            Surface::Cone(cone) => cone.jet(s, r),
        };
        // The surface has x across the axis; rotate it so that x is along u.
        let turned = |p: Vec3| Vec3::new(ay * p.x + ax * p.y, -ax * p.x + ay * p.y, p.z);
        let jet = jet.reparameterized(jacobian);
        Jet {
            point: turned(jet.point),
            du: turned(jet.du),
            dv: turned(jet.dv),
            normal: turned(jet.normal),
            normal_du: turned(jet.normal_du),
            normal_dv: turned(jet.normal_dv),
        }
    }

    /// Returns the parallel surface `h` metres above the mid-surface, scanner frame, with derivatives by (u, v).
    pub fn jet(&self, u: f64, v: f64, h: f64) -> Jet {
        let jet = self.local_jet(u, v).offset(h);
        let turn = &self.scanner_from_plate.rotation;
        Jet {
            point: turn * jet.point + self.scanner_from_plate.translation.vector,
            du: turn * jet.du,
            dv: turn * jet.dv,
            normal: turn * jet.normal,
            normal_du: turn * jet.normal_du,
            normal_dv: turn * jet.normal_dv,
        }
    }

    /// Returns a point of the mid-surface, scanner frame.
    pub fn mid(&self, u: f64, v: f64) -> Vec3 {
        self.jet(u, v, 0.0).point
    }

    /// Returns the upper unit normal, scanner frame; it is the same on mid-surface and faces.
    pub fn normal(&self, u: f64, v: f64) -> Vec3 {
        self.jet(u, v, 0.0).normal
    }

    /// Returns a point of the upper face, the one that is scanned.
    pub fn top(&self, u: f64, v: f64) -> Vec3 {
        self.jet(u, v, self.thickness / 2.0).point
    }

    /// Returns a point of the underside.
    pub fn underside(&self, u: f64, v: f64) -> Vec3 {
        self.jet(u, v, -self.thickness / 2.0).point
    }

    /// Returns the corners (0,0), (W,0), (W,H), (0,H) of the upper face.
    pub fn corners(&self) -> [Vec3; 4] {
        [(0.0, 0.0), (self.width, 0.0), (self.width, self.height), (0.0, self.height)].map(|(a, b)| {
            let ([u, v], _) = self.material(a, b);
            self.top(u, v)
        })
    }

    /// Returns the material point (u, v) at (a, b) of the ordered rectangle and its derivatives
    /// `[[du/da, du/db], [dv/da, dv/db]]`: the identity unless the blank has cutting errors.
    pub fn material(&self, a: f64, b: f64) -> ([f64; 2], [[f64; 2]; 2]) {
        match &self.cut {
            Some(cut) => cut.material(a, b),
            None => ([a, b], [[1.0, 0.0], [0.0, 1.0]]),
        }
    }

    /// Returns the material point (u, v) at the fraction `along` (0..1) of a side face.
    pub fn side_uv(&self, side: Side, along: f64) -> [f64; 2] {
        let [a, b] = match side {
            Side::Bottom => [along * self.width, 0.0],
            Side::Right => [self.width, along * self.height],
            Side::Top => [along * self.width, self.height],
            Side::Left => [0.0, along * self.height],
        };
        self.material(a, b).0
    }

    /// Returns the curvature of the parallel surface `h` metres above the mid-surface, from its two fundamental forms.
    pub fn curvature(&self, u: f64, v: f64, h: f64) -> Curvature {
        let jet = self.local_jet(u, v).offset(h);
        let [e, f, g] = [jet.du.dot(&jet.du), jet.du.dot(&jet.dv), jet.dv.dot(&jet.dv)];
        let l = -jet.du.dot(&jet.normal_du);
        let m = -jet.du.dot(&jet.normal_dv);
        let n = -jet.dv.dot(&jet.normal_dv);
        let area = e * g - f * f;
        Curvature {
            kappa_u: l / e,
            kappa_v: n / g,
            kappa_uv: m / (e * g).sqrt(),
            mean: (l * g - 2.0 * m * f + n * e) / (2.0 * area),
            gauss: (l * n - m * m) / area,
        }
    }
}

/// Builds the surface of a shape; returns it with the direction of its axis in (u, v).
fn surface(shape: &Shape, width: f64, height: f64) -> Result<(Surface, [f64; 2]), PlateError> {
    // The material map may move points slightly beyond the rectangle.
    let reach = 0.5 * width.hypot(height) * 1.05;
    let constant = |kappa: f64| Profile::new(kappa, Vec::new(), reach);
    let along = |axis_deg: f64| {
        let (sin, cos) = axis_deg.to_radians().sin_cos();
        [cos, sin]
    };
    let swept = |profile, section| Surface::Swept(Box::new(SweptSurface { profile, section }));
    Ok(match shape {
        Shape::Flat => (swept(constant(0.0), constant(0.0)), along(90.0)),
        Shape::Cylinder { radius_mm, axis_deg } => {
            (swept(constant(curvature("radius_mm", *radius_mm)?), constant(0.0)), along(*axis_deg))
        }
        Shape::Sphere { radius_mm } => {
            let kappa = curvature("radius_mm", *radius_mm)?;
            (swept(constant(kappa), constant(kappa)), along(90.0))
        }
        Shape::Torus { axis_deg, radius_mm, cross_radius_mm } => {
            let cross = constant(curvature("cross_radius_mm", *cross_radius_mm)?);
            (swept(cross, constant(curvature("radius_mm", *radius_mm)?)), along(*axis_deg))
        }
        Shape::Steps { axis_deg, curvature_per_m, steps } => {
            (swept(step_profile(*curvature_per_m, steps, reach)?, constant(0.0)), along(*axis_deg))
        }
        Shape::Bands { axis_deg, bands, cross_bands } => {
            (swept(band_profile(bands, reach)?, band_profile(cross_bands, reach)?), along(*axis_deg))
        }
        Shape::Cone { axis_deg, radius_start_mm, radius_end_mm } => {
            let (cone, flipped) = cone(along(*axis_deg), *radius_start_mm, *radius_end_mm, width, height)?;
            (Surface::Cone(cone), along(if flipped { axis_deg + 180.0 } else { *axis_deg }))
        }
    })
}

/// Builds a cone; returns it with true when its axis must be reversed to lead away from the apex.
fn cone(
    axis: [f64; 2],
    start_mm: f64,
    end_mm: f64,
    width: f64,
    height: f64,
) -> Result<(Cone, bool), PlateError> {
    let start = 1.0 / curvature("radius_start_mm", start_mm)?;
    let end = 1.0 / curvature("radius_end_mm", end_mm)?;
    let fault = |advice| PlateError::Description { key: "radius_end_mm", found: end_mm, advice };
    if start * end < 0.0 {
        return Err(fault("both radii of a cone have the same sign"));
    }
    // Half the length of the middle generator, to the nearer pair of edges.
    let half = (width / 2.0 / axis[0].abs()).min(height / 2.0 / axis[1].abs());
    let growth = (end.abs() - start.abs()).abs() / (2.0 * half);
    if growth < 1e-6 {
        return Err(fault("both radii are equal: write a cylinder"));
    }
    let radius = (start.abs() + end.abs()) / 2.0;
    if radius / growth <= 0.5 * width.hypot(height) {
        return Err(fault("the apex of the cone lies on the plate; write radii that differ less"));
    }
    Ok((Cone::new(radius, growth, start.signum()), end.abs() < start.abs()))
}
