//! Measurement of columns: rays of the lattice, echoes of the footprint, errors of the receiver.

use crate::beam::{BeamRay, RIM};
use crate::column::{SimColumn, SimState, TruthCell};
use crate::instrument::Instrument;
use crate::lattice::{SimLattice, unit};
use crate::ray::{Hit, Label, Ray};
use crate::scene::Scene;
use platen_sim_plate::Vec3;
use rand_distr::{Distribution, StandardNormal, StudentT};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::RngCore;

/// Range difference of neighbouring cells of one object that is treated as an edge, metres.
const RANGE_JUMP: f64 = 0.1;

/// Range spread within a footprint above which a cell counts as a mixed pixel, metres.
const MIXED_SPREAD: f64 = 0.02;

/// Standard deviation of a range before the laser is warm, metres.
const WARM_UP_SIGMA: f64 = 0.03;

/// Largest intensity.
pub const INTENSITY_MAX: u16 = 2047;

/// Rays through the middle of every cell of one column, and their hits without range errors.
#[derive(Debug)]
pub(crate) struct Trace {
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
}

/// Scene, lattice and instrument of a scan.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) lattice: &'a SimLattice,
    pub(crate) instrument: &'a Instrument,
}

/// Purpose of a column's random numbers; each purpose has its own stream, so that switching one error on
/// does not change the others' numbers.
#[derive(Clone, Copy)]
enum Purpose {
    Angles = 0,
    Ranges = 1,
    WideErrors = 2,
}

impl View<'_> {
    fn rng(&self, column: u32, purpose: Purpose) -> Pcg64 {
        // Two purposes alternate; a third one lies beyond all columns.
        let stream = match purpose {
            Purpose::Angles | Purpose::Ranges => u128::from(column) * 2 + purpose as u128,
            Purpose::WideErrors => (1 << 64) + u128::from(column),
        };
        Pcg64::new(u128::from(self.instrument.seed), stream)
    }

    fn is_back(&self, column: u32) -> bool {
        self.instrument.faces.is_some_and(|faces| (column >= faces.seam_column) != self.instrument.clockwise)
    }

    /// Returns true for the first columns that either face measures after the laser is switched on.
    fn is_warm_up(&self, column: u32) -> bool {
        let seam = self.instrument.faces.map_or(0, |faces| faces.seam_column);
        let face = if column < seam { 0..seam } else { seam..self.lattice.n_columns };
        let before = if self.instrument.clockwise { face.end - 1 - column } else { column - face.start };
        before < self.instrument.warm_up_columns
    }

    /// Casts the middle ray of every cell of a column.
    pub(crate) fn trace(&self, column: u32) -> Trace {
        let mut rng = self.rng(column, Purpose::Angles);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let azimuth = self.lattice.azimuth(column);
        let sigma = self.instrument.angular_sigma;
        let rays: Vec<Ray> = (0..self.lattice.n_rows)
            .map(|row| {
                let elevation = self.lattice.elevation(row);
                let (across, up) = (sigma * normal(), sigma * normal());
                let azimuth = azimuth + self.azimuth_error(column, elevation) + across;
                Ray { origin: self.origin(column), direction: unit(azimuth, elevation + up) }
            })
            .collect();
        let hits = rays.iter().map(|ray| self.cast(ray)).collect();
        Trace { rays, hits }
    }

    fn cast(&self, ray: &Ray) -> Option<Hit> {
        let [nearest, farthest] = self.instrument.reach;
        self.scene.cast(ray, farthest).filter(|hit| hit.range >= nearest)
    }

    fn origin(&self, column: u32) -> Vec3 {
        match self.instrument.faces {
            Some(faces) if self.is_back(column) => Vec3::from(faces.moved),
            _ => Vec3::zeros(),
        }
    }

    /// Returns the azimuth error of collimation and trunnion axis, which changes sign between the faces.
    fn azimuth_error(&self, column: u32, elevation: f64) -> f64 {
        let Some(faces) = self.instrument.faces else { return 0.0 };
        let error = faces.collimation / elevation.cos() + faces.trunnion * elevation.tan();
        if self.is_back(column) { -error } else { error }
    }

    /// Measures a column; its neighbours are used to find edges.
    pub(crate) fn measure(
        &self,
        column: u32,
        before: Option<&Trace>,
        here: &Trace,
        after: Option<&Trace>,
    ) -> SimColumn {
        let n = here.rays.len();
        let mut rng = self.rng(column, Purpose::Ranges);
        let mut wide = self.rng(column, Purpose::WideErrors);
        let mut out = SimColumn {
            index: column,
            back_face: self.is_back(column),
            range_m: Vec::with_capacity(n),
            azimuth: vec![self.lattice.azimuth(column); n],
            elevation: (0..self.lattice.n_rows).map(|row| self.lattice.elevation(row)).collect(),
            intensity: Vec::with_capacity(n),
            state: Vec::with_capacity(n),
            truth: Vec::with_capacity(n),
        };
        for row in 0..n {
            let neighbours = [before, Some(here), after].into_iter().flatten();
            let echo = if is_at_edge(row, here, neighbours) && self.instrument.footprint > 0.0 {
                self.footprint_echo(&here.rays[row], here.hits[row], self.instrument.beam.turned(column, row))
            } else {
                here.hits[row].map(|hit| self.echo(&hit))
            };
            let (state, range, intensity) = self.receive(column, echo, self.spread(&mut wide), &mut rng);
            out.range_m.push(range as f32);
            out.intensity.push(intensity);
            out.state.push(state);
            out.truth.push(TruthCell {
                label: here.hits[row].map_or(Label::Nothing, |hit| hit.label),
                mixed: echo.is_some_and(|echo| echo.mixed),
                range: here.hits[row].map_or(0.0, |hit| hit.range),
            });
        }
        out
    }

    /// Returns the echo of a ray; its strength is relative to a white wall at normal incidence at the same distance
    /// (Lambert's law).
    fn echo(&self, hit: &Hit) -> Echo {
        Echo { hit: *hit, strength: self.scene.reflectivity(hit) * hit.cos_incidence, mixed: false }
    }

    /// Returns the echo of the whole footprint. A phase scanner integrates the echoes of the whole spot: the range is
    /// the mean, weighted by power, which falls with the square of the distance. The rays of the spot are turned by an
    /// angle. If the rim of the spot and the middle ray lie on one surface, the echo is that of the middle ray.
    fn footprint_echo(&self, ray: &Ray, middle: Option<Hit>, turned: f64) -> Option<Echo> {
        let level = ray.direction.cross(&Vec3::z()).try_normalize(1e-9).unwrap_or(Vec3::x());
        let upright = level.cross(&ray.direction);
        let (sin, cos) = turned.sin_cos();
        let (across, up) = (level * cos + upright * sin, upright * cos - level * sin);
        let spot = self.instrument.beam.rays();
        let radius = self.instrument.footprint / 2.0;
        let cast = |(x, y, _): &BeamRay| {
            let direction = (ray.direction + across * (x * radius) + up * (y * radius)).normalize();
            self.cast(&Ray { origin: ray.origin, direction })
        };
        let (inner, rim) = spot.split_at(spot.len() - RIM);
        let rim: [Option<Hit>; RIM] = std::array::from_fn(|k| cast(&rim[k]));
        if rim.iter().all(|hit| is_one_surface(&middle, hit, MIXED_SPREAD)) {
            return middle.map(|hit| self.echo(&hit));
        }
        let whole: f64 = spot.iter().map(|(_, _, weight)| weight).sum();
        let (mut power, mut range, mut strength) = (0.0, 0.0, 0.0);
        let (mut nearest, mut farthest) = (f64::INFINITY, 0.0_f64);
        let mut nearest_hit = middle;
        for ((_, _, weight), hit) in spot.iter().zip(inner.iter().map(cast).chain(rim)) {
            let Some(hit) = hit else { continue };
            let echo = self.echo(&hit);
            let received = weight * echo.strength / (hit.range * hit.range);
            power += received;
            range += received * hit.range;
            strength += weight / whole * echo.strength;
            if hit.range < nearest {
                (nearest, nearest_hit) = (hit.range, Some(hit));
            }
            farthest = farthest.max(hit.range);
        }
        if power == 0.0 {
            return None;
        }
        let mixed = farthest - nearest > MIXED_SPREAD;
        // Without a range jump the middle of the beam is more exact than the mean of the samples.
        let hit =
            if mixed { Hit { range: range / power, ..nearest_hit? } } else { middle.or(nearest_hit)? };
        Some(Echo { hit, strength, mixed })
    }

    /// Draws the factor of a range's standard deviation.
    fn spread(&self, rng: &mut Pcg64) -> f64 {
        let wide = self.instrument.wide_errors.filter(|wide| unit_interval(rng) < wide.share);
        wide.map_or(1.0, |wide| wide.factor)
    }

    /// Simulates the receiver: returns state, range and intensity of an echo. `spread` is a factor of the range's
    /// standard deviation.
    fn receive(&self, column: u32, echo: Option<Echo>, spread: f64, rng: &mut Pcg64) -> (SimState, f64, u16) {
        // Every cell draws the same number of deviates, with or without an echo.
        let lost = unit_interval(rng);
        let error = self.unit_error(rng);
        let gain: f64 = StandardNormal.sample(rng);
        let Some(Echo { hit, strength, .. }) = echo else { return (SimState::NoEcho, 0.0, 0) };
        if lost < self.instrument.loss(&hit, strength) {
            return (SimState::NoEcho, 0.0, 0);
        }
        let mut sigma = spread * self.instrument.sigma_at(hit.range, strength);
        if self.is_warm_up(column) {
            sigma = sigma.max(WARM_UP_SIGMA);
        }
        let range = hit.range + self.instrument.bias(hit.range) + sigma * error;
        let level = f64::from(INTENSITY_MAX) * strength.sqrt() * (1.0 + 0.01 * gain);
        if range < self.instrument.reach[0] {
            return (SimState::NoEcho, 0.0, 0);
        }
        (SimState::Valid, range, level.clamp(1.0, f64::from(INTENSITY_MAX)) as u16)
    }

    /// Draws a range error of variance 1.
    fn unit_error(&self, rng: &mut Pcg64) -> f64 {
        match self.instrument.tail_dof {
            Some(dof) if dof > 2.0 => {
                StudentT::new(dof).map_or(0.0, |t| t.sample(rng)) * ((dof - 2.0) / dof).sqrt()
            }
            _ => StandardNormal.sample(rng),
        }
    }
}

/// Echo at the receiver.
#[derive(Debug, Clone, Copy)]
struct Echo {
    hit: Hit,
    strength: f64,
    mixed: bool,
}

/// Returns true when one of the eight neighbours lies on another object or across a range jump.
fn is_at_edge<'a>(row: usize, here: &Trace, columns: impl Iterator<Item = &'a Trace>) -> bool {
    let differs = |other: &Option<Hit>| !is_one_surface(&here.hits[row], other, RANGE_JUMP);
    let rows = row.saturating_sub(1)..(row + 2).min(here.hits.len());
    columns.into_iter().any(|column| column.hits[rows.clone()].iter().any(differs))
}

/// Returns true when two rays hit one object at ranges that differ by no more than `jump`, or both hit nothing.
fn is_one_surface(a: &Option<Hit>, b: &Option<Hit>, jump: f64) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => a.object == b.object && (a.range - b.range).abs() <= jump,
        (None, None) => true,
        _ => false,
    }
}

/// Draws a uniform deviate in [0, 1).
fn unit_interval(rng: &mut Pcg64) -> f64 {
    (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}
