//! Scene of a scan: plate and surroundings with their bounding volume hierarchies.

use crate::bounds::{Bounds, Tree};
use crate::instrument::{MARKER_REFLECTIVITY, PLATE_REFLECTIVITY, reflectivity};
use crate::patch::{Patch, PatchHit};
use crate::ray::{Hit, Label, Ray};
use crate::solid::Solid;
use crate::surroundings::{self, Surroundings};
use platen_sim_plate::{Plate, Vec3};

/// First object number of solids; lower numbers are the plate's faces.
const FIRST_SOLID: u16 = 16;

/// Radius of a painted marker, metres.
pub const MARKER_RADIUS: f64 = 0.02;

/// Plate and surroundings, prepared for ray casting. Scanner frame, metres; the scanner is at the origin.
#[derive(Debug, Clone)]
pub struct Scene {
    plate: Option<Plate>,
    patches: Vec<Patch>,
    patch_tree: Tree,
    plate_reflectivity: f64,
    solids: Vec<(Label, Solid)>,
    solid_tree: Tree,
}

impl Scene {
    /// Builds a press shop around `plate`, or an empty press.
    pub fn new(plate: Option<Plate>, surroundings: &Surroundings) -> Self {
        let solids = surroundings::solids(plate.as_ref(), surroundings);
        Self::of(plate, solids)
    }

    /// Builds a scene of a plate and given solids.
    pub fn of(plate: Option<Plate>, solids: Vec<(Label, Solid)>) -> Self {
        let patches = plate.as_ref().map(Patch::all).unwrap_or_default();
        let bounds = |plate: &Plate| patches.iter().map(|patch| patch.bounds(plate)).collect();
        let patch_bounds: Vec<Bounds> = plate.as_ref().map(bounds).unwrap_or_default();
        let solid_bounds: Vec<Bounds> = solids.iter().map(|(_, solid)| solid.bounds()).collect();
        let (patch_tree, solid_tree) = (Tree::new(&patch_bounds), Tree::new(&solid_bounds));
        Self { plate, patches, patch_tree, plate_reflectivity: PLATE_REFLECTIVITY, solids, solid_tree }
    }

    /// Returns the scene with a plate whose faces have this diffuse reflectivity, 0 to 1: rust is dark, primer is
    /// bright.
    #[must_use]
    pub fn with_plate_reflectivity(self, plate_reflectivity: f64) -> Self {
        Self { plate_reflectivity, ..self }
    }

    /// Returns the plate, if any.
    pub fn plate(&self) -> Option<&Plate> {
        self.plate.as_ref()
    }

    /// Returns the nearest hit within `reach` metres. Hits on the plate are exact to 1e-11 m.
    pub fn cast(&self, ray: &Ray, reach: f64) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        let mut keep = |hit: Option<Hit>, limit: f64| match hit.filter(|hit| hit.range < limit) {
            Some(hit) => {
                nearest = Some(hit);
                hit.range
            }
            None => limit,
        };
        let mut limit = reach;
        self.solid_tree.visit(ray, reach, |item, nearest| {
            limit = keep(self.solid_hit(item as usize, ray), nearest);
            limit
        });
        if let Some(plate) = &self.plate {
            self.patch_tree.visit(ray, limit, |item, nearest| {
                let patch = &self.patches[item as usize];
                keep(patch.cast(plate, ray).map(|hit| plate_hit(patch, &hit, ray)), nearest)
            });
        }
        nearest
    }

    fn solid_hit(&self, index: usize, ray: &Ray) -> Option<Hit> {
        let (label, solid) = &self.solids[index];
        let (range, normal) = solid.cast(ray)?;
        let cos_incidence = normal.dot(&ray.direction).abs();
        Some(Hit { range, cos_incidence, label: *label, object: FIRST_SOLID + index as u16, uv: None })
    }

    /// Returns true when a material point of the upper face lies on a painted marker.
    pub fn is_marker(&self, [u, v]: [f64; 2]) -> bool {
        let near = |marker: &[f64; 2]| (marker[0] - u).hypot(marker[1] - v) < MARKER_RADIUS;
        self.plate.as_ref().is_some_and(|plate| plate.markers().iter().any(near))
    }

    /// Returns the diffuse reflectivity where a ray hits.
    pub(crate) fn reflectivity(&self, hit: &Hit) -> f64 {
        let painted = hit.label == Label::PlateTop && hit.uv.is_some_and(|uv| self.is_marker(uv));
        if painted { MARKER_REFLECTIVITY } else { reflectivity(hit.label, self.plate_reflectivity) }
    }

    /// Returns true when a point of the upper face is visible from the scanner.
    pub fn sees(&self, point: Vec3) -> bool {
        let range = point.norm();
        let ray = Ray { origin: Vec3::zeros(), direction: point / range };
        self.cast(&ray, range + 1e-6)
            .is_some_and(|hit| hit.label == Label::PlateTop && (hit.range - range).abs() < 1e-6)
    }
}

fn plate_hit(patch: &Patch, hit: &PatchHit, ray: &Ray) -> Hit {
    Hit {
        range: hit.range,
        cos_incidence: hit.normal.dot(&ray.direction).abs(),
        label: patch.label(),
        object: patch.object(),
        uv: Some(hit.uv),
    }
}
