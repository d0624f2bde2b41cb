//! Scans of closed-form plates, each determined by its seed.
//!
//! A scene consists of a flat or cylindrical plate with its side faces over a floor, and people as upright cylinders.
//! The scan has range noise with heavy tails, dropouts and mixed pixels.

#![allow(dead_code, unreachable_pub, reason = "test code of which every file uses its own part")]

use platen_scan::{Column, Direction, Face, ScanHeader, State};
use platen_shape::{PlateSpec, Vec3};

/// Random generator (SplitMix64) with which a seed always gives the same scan.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// A plate of `width` along its local x, `height` along its local y, its mid-surface through the local origin.
#[derive(Clone, Copy)]
pub struct Plate {
    pub width: f64,
    pub height: f64,
    pub thickness: f64,
    /// Radius of the mid-surface, its axis along y above the plate (concave face up); negative: below. `None`: flat.
    pub radius: Option<f64>,
    /// Middle of the mid-surface, metres, scanner frame.
    pub centre: Vec3,
    /// Rotation about the vertical, radians.
    pub turn: f64,
    /// Rotation before that, which lifts the far end about the horizontal across, radians.
    pub tilt: f64,
}

impl Plate {
    /// Returns a plate rolled to a radius of 9 m, concave face up, placed obliquely in front of the scanner.
    pub fn rolled() -> Self {
        Self {
            width: 3.0,
            height: 2.5,
            thickness: 0.036,
            radius: Some(9.0),
            centre: Vec3::new(6.0, 0.4, -3.6),
            turn: 0.4,
            tilt: 0.0,
        }
    }

    fn to_local(self, v: Vec3) -> Vec3 {
        let (s, c) = self.turn.sin_cos();
        let v = Vec3::new(c * v.x + s * v.y, c * v.y - s * v.x, v.z);
        let (s, c) = self.tilt.sin_cos();
        Vec3::new(c * v.x + s * v.z, v.y, c * v.z - s * v.x)
    }

    fn to_scanner(self, v: Vec3) -> Vec3 {
        let (s, c) = self.tilt.sin_cos();
        let v = Vec3::new(c * v.x - s * v.z, v.y, c * v.z + s * v.x);
        let (s, c) = self.turn.sin_cos();
        Vec3::new(c * v.x - s * v.y, s * v.x + c * v.y, v.z)
    }

    /// Returns the material coordinates (u, v) of a point on or in the plate, scanner frame.
    fn material(&self, point: Vec3) -> [f64; 2] {
        let p = self.to_local(point - self.centre);
        let x = self.radius.map_or(p.x, |r| r * (p.x / r).atan2(-(p.z - r) / r));
        [x + 0.5 * self.width, p.y + 0.5 * self.height]
    }

    /// Returns the unit normal of the faces at a point, scanner frame.
    fn normal(&self, point: Vec3) -> Vec3 {
        let p = self.to_local(point - self.centre);
        self.to_scanner(self.radius.map_or(Vec3::z(), |r| Vec3::new(p.x, 0.0, p.z - r).normalize()))
    }

    /// Returns the upper face's point above (u, v) of the mid-surface, scanner frame.
    pub fn face(&self, u: f64, v: f64) -> Vec3 {
        let (x, y) = (u - 0.5 * self.width, v - 0.5 * self.height);
        let local = match self.radius {
            None => Vec3::new(x, y, 0.5 * self.thickness),
            Some(r) => {
                let (s, c) = (x / r).sin_cos();
                let face = r - 0.5 * self.thickness;
                Vec3::new(face * s, y, r - face * c)
            }
        };
        self.centre + self.to_scanner(local)
    }

    /// Returns the range of the first hit, metres.
    fn hit(&self, beam: Vec3) -> Option<f64> {
        let (o, d) = (self.to_local(-self.centre), self.to_local(beam));
        let half = Vec3::new(0.5 * self.width, 0.5 * self.height, 0.5 * self.thickness);
        let mut ranges = Vec::with_capacity(8);
        let plane = |offset: f64, slope: f64| -offset / slope;
        ranges.extend([plane(o.y - half.y, d.y), plane(o.y + half.y, d.y)]);
        match self.radius {
            None => {
                for side in [-1.0, 1.0] {
                    ranges.extend([plane(o.x + side * half.x, d.x), plane(o.z + side * half.z, d.z)]);
                }
            }
            Some(r) => {
                // About the axis: x, z - r.
                let (ox, oz) = (o.x, o.z - r);
                for side in [-1.0, 1.0] {
                    let (s, c) = (side * half.x / r).sin_cos();
                    // The plane through the axis and this end of the plate: x c + (z - r) s = 0.
                    ranges.push(plane(ox * c + oz * s, d.x * c + d.z * s));
                    let face = r + side * half.z;
                    let (a, b) = (d.x * d.x + d.z * d.z, ox * d.x + oz * d.z);
                    let discriminant = b * b - a * (ox * ox + oz * oz - face * face);
                    if discriminant > 0.0 {
                        ranges.extend([(-b - discriminant.sqrt()) / a, (-b + discriminant.sqrt()) / a]);
                    }
                }
            }
        }
        let inside = |range: &f64| {
            const SLACK: f64 = 1e-9;
            let p = o + d * *range;
            let (x, z) = match self.radius {
                None => (p.x, p.z),
                Some(r) => {
                    let (x, z) = (p.x, p.z - r);
                    let from_axis = x.hypot(z) * r.signum();
                    (r * (x / r).atan2(-z / r), r - from_axis)
                }
            };
            *range > 0.0 && x.abs() < half.x + SLACK && p.y.abs() < half.y + SLACK && z.abs() < half.z + SLACK
        };
        ranges.into_iter().filter(inside).min_by(f64::total_cmp)
    }
}

/// Range of the wall that closes the room.
const WALL: f64 = 15.0;

/// Range that a receiver gives for a beam that sees two surfaces.
#[derive(Clone, Copy, PartialEq)]
pub enum Receiver {
    /// Any range between those of both, for three quarters of the beams of which a corner sees beyond an edge.
    Anywhere,
    /// The mean over a Gaussian beam, weighted by power (Lambert's law); `plates` is the reflectivity of plates over
    /// that of the floor.
    Linear { plates: f64 },
}

/// A scene and the parameters of its scan.
#[derive(Clone)]
pub struct Scene {
    pub plates: Vec<Plate>,
    /// Upright cylinders: x, y, radius, lowest and highest z.
    pub people: Vec<[f64; 5]>,
    /// Height of the floor, below the scanner.
    pub floor: f64,
    /// Angle between beams, radians.
    pub step: f64,
    /// Half the angle that a beam sees.
    pub footprint: f64,
    pub receiver: Receiver,
    /// Standard deviation of the range, metres.
    pub sigma: f64,
    /// Part of the samples with four times that standard deviation.
    pub tails: f64,
    pub dropouts: f64,
    /// Material rectangle of the first plate, from (u, v) to (u, v), that mirrors the beam away.
    pub specular: Option<[[f64; 2]; 2]>,
    pub seed: u64,
}

impl Scene {
    pub fn of(plate: Plate) -> Self {
        Self {
            plates: vec![plate],
            people: Vec::new(),
            floor: -4.5,
            step: 0.05_f64.to_radians(),
            footprint: 1.5e-4,
            receiver: Receiver::Anywhere,
            sigma: 5e-4,
            tails: 0.0,
            dropouts: 0.01,
            specular: None,
            seed: 1,
        }
    }

    pub fn spec(&self) -> PlateSpec {
        let plate = &self.plates[0];
        PlateSpec {
            width: plate.width,
            height: plate.height,
            thickness: plate.thickness,
            face_inset: 0.0,
            root_face: 0.0,
            u_axis: Some(plate.to_scanner(Vec3::x())),
            region: None,
        }
    }

    fn range(&self, beam: Vec3) -> f64 {
        self.plates.iter().filter_map(|p| p.hit(beam)).fold(self.range_beside_plates(beam), f64::min)
    }

    fn range_beside_plates(&self, beam: Vec3) -> f64 {
        let floor = if beam.z < 0.0 { self.floor / beam.z } else { f64::MAX };
        let people = self.people.iter().filter_map(|&[x, y, radius, low, high]| {
            let (a, b) = (beam.x.powi(2) + beam.y.powi(2), beam.x * x + beam.y * y);
            let discriminant = b * b - a * (x * x + y * y - radius * radius);
            let range = (b - discriminant.max(0.0).sqrt()) / a;
            (discriminant > 0.0 && (low..high).contains(&(range * beam.z))).then_some(range)
        });
        people.fold(floor.min(WALL), f64::min)
    }

    /// Returns the range of one ray and the power of its echo, relative to the echo of the floor straight below at one
    /// metre.
    fn echo(&self, beam: Vec3, plates: f64) -> (f64, f64) {
        let behind = self.range_beside_plates(beam);
        let hits = self.plates.iter().filter_map(|plate| Some((plate.hit(beam)?, plate)));
        let nearest = hits.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(range, _)| *range < behind);
        let (range, reflects, cosine) = match nearest {
            Some((range, plate)) => (range, plates, plate.normal(beam * range).dot(&beam).abs()),
            None if behind < WALL => (behind, 1.0, beam.z.abs()),
            None => (behind, 1.0, 1.0),
        };
        (range, reflects * cosine / (range * range))
    }

    /// Returns the mean range over a Gaussian beam whose directions from its middle are given in its radii.
    fn mean_range(&self, beam: impl Fn(f64, f64) -> Vec3, plates: f64, turned: f64) -> f64 {
        const SAMPLES: usize = 200;
        let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let echo = |k: usize| {
            let radius = ((k as f64 + 0.5) / SAMPLES as f64).sqrt();
            let (sin, cos) = (golden_angle * k as f64 + turned).sin_cos();
            let (range, power) = self.echo(beam(radius * cos, radius * sin), plates);
            (range, power * (-2.0 * radius * radius).exp())
        };
        let sum = (0..SAMPLES).map(echo).fold((0.0, 0.0), |sum, (r, p)| (sum.0 + r * p, sum.1 + p));
        sum.0 / sum.1
    }

    /// Returns the scan over the plates and half a metre around them.
    pub fn scan(&self) -> (ScanHeader, Vec<Column>) {
        self.scan_around(0.08)
    }

    /// Returns the scan over the plates and `around` radians beside them, within a full dome.
    pub fn scan_around(&self, around: f64) -> (ScanHeader, Vec<Column>) {
        let corners = self.plates.iter().flat_map(|p| {
            [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.5, 0.5)]
                .map(|(u, v)| Direction::of(p.face(u * p.width, v * p.height).into()))
        });
        let corners: Vec<_> = corners.collect();
        let span = |f: fn(&Direction) -> f64| {
            let (low, high) =
                corners.iter().map(f).fold((9.0, -9.0), |(l, h), a| (f64::min(l, a), f64::max(h, a)));
            (low - around, high + around)
        };
        let (mut az, mut el) = (span(|d| d.azimuth), span(|d| d.elevation));
        az = (az.0.max(-std::f64::consts::PI), az.1.min(std::f64::consts::PI));
        el = (el.0.max(-62.5_f64.to_radians()), el.1.min(std::f64::consts::FRAC_PI_2));
        let ((az_low, az_high), (el_low, el_high)) = (az, el);
        let header = ScanHeader {
            n_rows: ((el_high - el_low) / self.step) as u32,
            n_columns: ((az_high - az_low) / self.step) as u32,
            azimuth_start: az_low,
            azimuth_step: self.step,
            elevation_start: el_high,
            elevation_step: self.step,
            intensity_range: (0, 1),
            simulated: true,
            ..ScanHeader::default()
        };
        let columns = (0..header.n_columns).map(|index| self.column(&header, index)).collect();
        (header, columns)
    }

    fn is_specular(&self, azimuth: f64, elevation: f64, range: f64) -> bool {
        let point = Vec3::from(Direction { azimuth, elevation }.unit()) * range;
        let on_plate = |d: [f64; 2], [from, to]: [[f64; 2]; 2]| {
            (0..2).all(|k| (from[k]..to[k]).contains(&d[k]))
                && self.plates[0].hit(point / range) == Some(range)
        };
        self.specular.is_some_and(|patch| on_plate(self.plates[0].material(point), patch))
    }

    fn column(&self, header: &ScanHeader, index: u32) -> Column {
        let mut random =
            Random::new(self.seed.wrapping_mul(0x1_0000_0001).wrapping_add(u64::from(index) << 20));
        let rows = header.n_rows as usize;
        let azimuth = header.azimuth_start + header.azimuth_step * f64::from(index);
        let mut column = Column {
            index,
            face: Face::Front,
            first_row: 0,
            range_m: vec![0.0; rows],
            azimuth: vec![azimuth; rows],
            elevation: Vec::with_capacity(rows),
            intensity: vec![1; rows],
            state: vec![State::NoReturn; rows],
        };
        for row in 0..rows {
            let elevation = header.elevation_start - header.elevation_step * row as f64;
            column.elevation.push(elevation);
            let direction = |across: f64, up: f64| {
                let d = Direction { azimuth: azimuth + across / elevation.cos(), elevation: elevation + up };
                Vec3::from(d.unit())
            };
            let beam = |across: f64, up: f64| self.range(direction(across, up));
            let f = self.footprint;
            let centre = beam(0.0, 0.0);
            let around = [beam(f, 0.0), beam(-f, 0.0), beam(0.0, f), beam(0.0, -f)];
            let other = around.into_iter().find(|r| (r - centre).abs() > 0.05);
            let (share, part) = (random.uniform(), random.uniform());
            let range = match (other, self.receiver) {
                (None, _) => centre,
                (Some(other), Receiver::Anywhere) if part < 0.75 => share * centre + (1.0 - share) * other,
                (Some(_), Receiver::Anywhere) => centre,
                (Some(_), Receiver::Linear { plates }) => {
                    self.mean_range(|x, y| direction(f * x, f * y), plates, std::f64::consts::TAU * share)
                }
            };
            let spread = if random.uniform() < self.tails { 4.0 } else { 1.0 };
            column.range_m[row] = range + self.sigma * spread * random.normal();
            if random.uniform() >= self.dropouts && !self.is_specular(azimuth, elevation, centre) {
                column.state[row] = State::Valid;
            }
        }
        column
    }
}
