//! Surroundings of the plate: dies, table, press, shop, people, a chain.

use crate::ray::Label;
use crate::solid::Solid;
use platen_sim_plate::{Plate, PlateState, Vec3};

/// Objects of the shop. The scanner is `-floor` metres above the floor and looks along +x to the press.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surroundings {
    /// Height of the floor in the scanner frame, metres (negative).
    pub floor: f64,
    /// Distance to the wall behind the press, metres.
    pub wall: f64,
    /// Frame and ram behind the plate are present.
    pub press: bool,
    /// A person stands beside the plate without hiding it.
    pub bystander: bool,
    /// A person stands in front of the plate and hides part of its near edge.
    pub person_in_front: bool,
    /// A person stands in front of the plate's nearest corner and hides it.
    pub person_at_corner: bool,
    /// The chain of a crane hangs in front of the plate and hides a strip.
    pub chain: bool,
    /// The table ends so close behind the plate that it is visible beyond the far edges by this angle, radians.
    pub strip: Option<f64>,
}

impl Default for Surroundings {
    fn default() -> Self {
        Self {
            floor: -4.5,
            wall: 12.0,
            press: true,
            bystander: true,
            person_in_front: false,
            person_at_corner: false,
            chain: false,
            strip: None,
        }
    }
}

/// Radius of the round head of a die, metres.
const DIE_RADIUS: f64 = 0.07;

/// Gap between table and plate, where the dies stand, metres.
const UNDER_PLATE: f64 = 0.35;

/// Returns all solids around `plate`, or around a plate of default pose when the press is empty.
pub(crate) fn solids(plate: Option<&Plate>, around: &Surroundings) -> Vec<(Label, Solid)> {
    let home = PlateState::flat(3000.0, 2500.0, 36.0).pose.scanner_from_plate().translation.vector;
    let centre = plate.map_or(home, |plate| plate.scanner_from_plate().translation.vector);
    let lowest = plate.map_or(centre.z, |plate| {
        let corners = plate.corners().map(|corner| corner.z);
        corners.into_iter().fold(centre.z, f64::min)
    });
    let table_top = lowest - UNDER_PLATE;
    // Horizontal directions away from the scanner and to the left of that.
    let away = Vec3::new(centre.x, centre.y, 0.0).try_normalize(1e-9).unwrap_or(Vec3::x());
    let left = Vec3::new(-away.y, away.x, 0.0);
    let yaw = away.y.atan2(away.x);
    let reach = plate.map_or(2.0, |plate| 0.5 * plate.width().hypot(plate.height()));
    let place = Place { centre, away, left, yaw, reach, floor: around.floor, table_top };

    let mut solids = vec![(Label::Floor, slab(around.floor))];
    solids.extend(walls(around).map(|wall| (Label::Wall, wall)));
    solids.push((Label::Cabinet, place.upright(2.5, reach + 2.5, 2.0, [0.6, 1.2, 2.0])));
    let narrow = plate.zip(around.strip).map(|(plate, strip)| place.narrow_table(plate, strip));
    solids.push((Label::Table, narrow.unwrap_or_else(|| place.table())));
    if let Some(plate) = plate {
        solids.extend(dies(plate, table_top).map(|die| (Label::Die, die)));
    }
    if around.press {
        solids.extend(place.press().map(|part| (Label::Press, part)));
    }
    if around.bystander {
        solids.extend(place.person(1.2, -(reach + 0.4)).map(|limb| (Label::Person, limb)));
    }
    if around.person_in_front {
        solids.extend(place.person(-(reach + 0.3), 0.35).map(|limb| (Label::Person, limb)));
    }
    if let Some(plate) = plate.filter(|_| around.person_at_corner) {
        let [away, left] = place.before_nearest_corner(plate);
        solids.extend(place.person(away, left).map(|limb| (Label::Person, limb)));
    }
    if around.chain {
        solids.extend(place.chain().map(|link| (Label::Chain, link)));
    }
    solids
}

fn slab(top: f64) -> Solid {
    Solid::upright(Vec3::new(0.0, 0.0, top - 0.1), Vec3::new(200.0, 200.0, 0.2), 0.0)
}

fn walls(around: &Surroundings) -> impl Iterator<Item = Solid> {
    let (height, middle) = (12.0, around.floor + 6.0);
    let wall = around.wall;
    [
        Solid::upright(Vec3::new(wall + 0.15, 0.0, middle), Vec3::new(0.3, 60.0, height), 0.0),
        Solid::upright(Vec3::new(-9.15, 0.0, middle), Vec3::new(0.3, 60.0, height), 0.0),
        Solid::upright(Vec3::new(0.0, 15.15, middle), Vec3::new(60.0, 0.3, height), 0.0),
        Solid::upright(Vec3::new(0.0, -15.15, middle), Vec3::new(60.0, 0.3, height), 0.0),
    ]
    .into_iter()
}

/// Returns dies in rows under the plate; their round heads touch its underside.
fn dies(plate: &Plate, table_top: f64) -> impl Iterator<Item = Solid> {
    let shares = [1.0 / 6.0, 0.5, 5.0 / 6.0];
    let at = move |i: usize| (shares[i / 2] * plate.width(), (0.2 + 0.6 * (i % 2) as f64) * plate.height());
    (0..6).map(move |i| {
        let (u, v) = at(i);
        let head = plate.underside(u, v) - plate.normal(u, v) * DIE_RADIUS;
        Solid::Capsule { ends: [Vec3::new(head.x, head.y, table_top), head], radius: DIE_RADIUS }
    })
}

/// Local directions at the plate by which the press is placed.
struct Place {
    centre: Vec3,
    away: Vec3,
    left: Vec3,
    yaw: f64,
    reach: f64,
    floor: f64,
    table_top: f64,
}

impl Place {
    fn at(&self, away: f64, left: f64, z: f64) -> Vec3 {
        let flat = self.centre + self.away * away + self.left * left;
        Vec3::new(flat.x, flat.y, z)
    }

    /// Returns a box that stands on the floor; its edges point away, left and up.
    fn upright(&self, away: f64, left: f64, height: f64, edges: [f64; 3]) -> Solid {
        let middle = self.at(away, left, self.floor + height / 2.0);
        Solid::upright(middle, Vec3::from(edges), self.yaw)
    }

    fn table(&self) -> Solid {
        let height = self.table_top - self.floor;
        let edge = 1.6 * self.reach;
        self.upright(0.0, 0.0, height, [edge, edge, height])
    }

    /// Returns a table parallel to the plate. A strip of it, given as an angle, is visible beyond those edges whose
    /// surroundings are seen over the plate; it extends from under the other edges.
    fn narrow_table(&self, plate: &Plate, strip: f64) -> Solid {
        /// Extent beyond the other edges, metres.
        const BESIDE: f64 = 0.3;
        let corners = plate.corners();
        let along = corners[1] - corners[0];
        let yaw = along.y.atan2(along.x);
        let axes = [Vec3::new(yaw.cos(), yaw.sin(), 0.0), Vec3::new(-yaw.sin(), yaw.cos(), 0.0)];
        // Ends of the table along each axis, about the middle of the plate.
        let mut ends = [[0.0; 2]; 2];
        for (edge, (axis, sign)) in [(1, -1.0), (0, 1.0), (1, 1.0), (0, -1.0)].into_iter().enumerate() {
            let outward = axes[axis] * sign;
            let middle = 0.5 * (corners[edge] + corners[(edge + 1) % 4]);
            let across = middle.xy().norm();
            // Beams over the edge, raised by the strip, meet the table's plane this far away.
            let behind = self.table_top / (middle.z.atan2(across) + strip).tan();
            let seen = middle.xy() * (behind / across);
            let beyond = (Vec3::new(seen.x, seen.y, 0.0) - self.centre).dot(&outward);
            let under = (middle - self.centre).dot(&outward) + BESIDE;
            ends[axis][usize::from(sign > 0.0)] =
                sign * if middle.dot(&outward) > 0.0 { beyond } else { under };
        }
        let middle =
            [0, 1].map(|k| axes[k] * (0.5 * (ends[k][0] + ends[k][1]))).iter().sum::<Vec3>() + self.centre;
        let height = self.table_top - self.floor;
        let edges = Vec3::new(ends[0][1] - ends[0][0], ends[1][1] - ends[1][0], height);
        Solid::upright(Vec3::new(middle.x, middle.y, self.floor + height / 2.0), edges, yaw)
    }

    /// Returns the position of a person who hides the plate's nearest corner: distances away from the middle and to the
    /// left.
    fn before_nearest_corner(&self, plate: &Plate) -> [f64; 2] {
        /// Of the way from the scanner to the corner.
        const SHARE: f64 = 0.97;
        let nearest = plate.corners().into_iter().min_by(|a, b| a.norm().total_cmp(&b.norm()));
        let off = nearest.unwrap_or(self.centre) * SHARE - self.centre;
        [off.dot(&self.away), off.dot(&self.left)]
    }

    /// Returns two columns, a beam and the ram behind the plate.
    fn press(&self) -> impl Iterator<Item = Solid> {
        let behind = self.reach + 0.6;
        let aside = self.reach + 0.5;
        let beam = self.at(behind, 0.0, self.floor + 4.6);
        let ram = self.at(behind, 0.0, self.floor + 3.4);
        [
            self.upright(behind, aside, 5.0, [0.6, 0.5, 5.0]),
            self.upright(behind, -aside, 5.0, [0.6, 0.5, 5.0]),
            Solid::upright(beam, Vec3::new(0.8, 2.0 * aside, 0.8), self.yaw),
            Solid::upright(ram, Vec3::new(0.5, 0.7, 1.6), self.yaw),
        ]
        .into_iter()
    }

    /// Returns the limbs of a person 1.78 m tall.
    fn person(&self, away: f64, left: f64) -> impl Iterator<Item = Solid> {
        let floor = self.floor;
        let limb = move |side: f64, from: f64, to: f64, radius: f64| {
            let at = |height: f64| self.at(away, left + side, floor + height);
            Solid::Capsule { ends: [at(from), at(to)], radius }
        };
        [
            limb(0.1, 0.08, 0.85, 0.08),
            limb(-0.1, 0.08, 0.85, 0.08),
            limb(0.0, 0.95, 1.4, 0.17),
            limb(0.27, 0.9, 1.4, 0.05),
            limb(-0.27, 0.9, 1.4, 0.05),
            limb(0.0, 1.66, 1.67, 0.11),
        ]
        .into_iter()
    }

    /// Returns chain links of 20 mm steel from above the line of sight down to the plate's height, alternately rotated.
    fn chain(&self) -> impl Iterator<Item = Solid> {
        const PITCH: f64 = 0.08;
        let top = 0.5;
        let bottom = self.centre.z + 0.6;
        let n = ((top - bottom) / PITCH) as usize;
        (0..n).flat_map(move |i| {
            let across = if i % 2 == 0 { self.left } else { self.away } * 0.025;
            let middle = self.at(-1.2, -0.5, top - PITCH * i as f64);
            let link = move |side: f64| {
                let foot = middle + across * side;
                let half = Vec3::z() * 0.05;
                Solid::Capsule { ends: [foot - half, foot + half], radius: 0.01 }
            };
            [link(1.0), link(-1.0)]
        })
    }
}
