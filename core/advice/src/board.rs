//! Boards: templates across the bends, with the height of the plate over the target along their lines, metres.
//!
//! On cylinder and cone a bend by the angle th along a line adds th times the distance behind the line to the height of
//! the plate over the target. Heights are therefore linear in the angles. They are integrated from the difference of
//! the curvatures of plate and target, in which earlier strokes add up without the error of slopes. A rigid motion of
//! the plate does not matter, since a template seats itself.

use platen_model::{Centre, Seat, Template};
use platen_shape::template_seat::{Profile, Seating};

use crate::bend_lines::BendLines;

/// Spacing of the places along a board's line, metres.
pub const STEP: f64 = 0.025;

/// Number of integration steps from one place to the next: the curvature of a sharp bend extends over a few
/// centimetres.
const FINE: usize = 5;

/// Step of the search for the worst place of a template, places.
const SLIDE: usize = 2;

/// A template on its line.
#[derive(Debug, Clone)]
pub struct Board {
    /// Name of the template.
    pub name: String,
    /// Largest gap that passes, metres.
    pub limit: f64,
    /// Uncertainty (95 %) of its gap at the last scan, metres.
    pub uncertainty: f64,
    chord: f64,
    centre: Centre,
    seat: Seat,
    /// Places along the line, metres from its first point.
    along: Vec<f64>,
    /// The same places on the plate, (u, v).
    at: Vec<[f64; 2]>,
    /// Height of the plate over the target, metres, towards the scanner.
    pub(crate) height: Vec<f64>,
}

/// Largest gap under a board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// Gap, metres.
    pub gap: f64,
    /// True when the board bridges the gap: the plate is more hollow there than the template.
    pub hollow: bool,
    /// Index of its place on the line.
    pub place: usize,
}

impl Board {
    /// Builds the board of a template on a line. The difference of curvature is plate minus target along the line, 1/m,
    /// positive towards the scanner, as a function of the distance along the line, metres.
    #[must_use]
    pub fn new(
        template: &Template,
        uncertainty: f64,
        from: [f64; 2],
        to: [f64; 2],
        difference: impl Fn(f64, [f64; 2]) -> f64,
    ) -> Self {
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        let n = (length / STEP).round().max(2.0) as usize;
        let step = length / n as f64;
        let fine = step / FINE as f64;
        let place = |s: f64| [0, 1].map(|k| from[k] + s / length * (to[k] - from[k]));
        let at_distance = |s: f64| difference(s.min(length), place(s.min(length)));
        let (mut height, mut slope, mut rise) = (vec![0.0], 0.0, 0.0);
        let mut first = at_distance(0.0);
        for k in 0..n * FINE {
            let s = fine * k as f64;
            let (middle, last) = (at_distance(s + 0.5 * fine), at_distance(s + fine));
            // Simpson's rule, exact for a curvature that is a parabola in each fine step.
            rise += slope * fine + fine * fine / 6.0 * (first + 2.0 * middle);
            slope += fine / 6.0 * (first + 4.0 * middle + last);
            first = last;
            if (k + 1) % FINE == 0 {
                height.push(rise);
            }
        }
        let along: Vec<f64> = (0..=n).map(|k| step * k as f64).collect();
        Self {
            name: template.name.clone(),
            limit: template.limit,
            uncertainty,
            chord: template.chord,
            centre: template.centre,
            seat: template.seat,
            at: along.iter().map(|s| place(*s)).collect(),
            along,
            height,
        }
    }

    /// Returns the change of the heights by a unit bend along the line x, metres per radian.
    pub(crate) fn ramp<'a>(&'a self, lines: &'a BendLines, x: f64) -> impl Iterator<Item = f64> + 'a {
        self.at.iter().map(move |at| lines.distance(x, *at).max(0.0))
    }

    /// Returns the place of an index on the plate.
    #[must_use]
    pub fn place(&self, index: usize) -> [f64; 2] {
        self.at[index]
    }

    /// Returns the heights of the plate over the target along the line, metres, towards the scanner.
    #[must_use]
    pub fn height(&self) -> &[f64] {
        &self.height
    }

    /// Returns the length of the template, metres.
    #[must_use]
    pub fn chord(&self) -> f64 {
        self.chord
    }

    /// Returns the largest gap for these heights of the plate over the target.
    #[must_use]
    pub fn worst(&self, height: &[f64]) -> Gap {
        let worst = self.gaps(height).reduce(|a, b| if b.gap > a.gap { b } else { a });
        worst.unwrap_or(Gap { gap: 0.0, hollow: false, place: 0 })
    }

    /// Returns the largest gap that the template bridges at any place along its line (`hollow`), or the largest gap
    /// that it does not bridge.
    pub(crate) fn largest(&self, height: &[f64], hollow: bool) -> f64 {
        let at_place = |(profile, seating, _): (Profile, Seating, usize)| {
            let bridged = bridged(&profile, &seating);
            let gaps = profile.gaps(&seating).into_iter().enumerate();
            let on_side = gaps.filter(|(k, gap)| bridged(*k, *gap) == hollow);
            on_side.fold(0.0, |largest: f64, (_, gap)| largest.max(gap.abs()))
        };
        self.seated(height).map(at_place).fold(0.0, f64::max)
    }

    /// Returns the largest gap at each place of the template along its line.
    pub(crate) fn gaps<'a>(&'a self, height: &'a [f64]) -> impl Iterator<Item = Gap> + 'a {
        self.seated(height).map(|(profile, seating, from)| {
            let gaps = profile.gaps(&seating);
            let largest =
                (0..gaps.len()).fold(0, |best, k| if gaps[k].abs() > gaps[best].abs() { k } else { best });
            let hollow = bridged(&profile, &seating)(largest, gaps[largest]);
            Gap { gap: gaps[largest].abs(), hollow, place: from + largest }
        })
    }

    /// Returns the template seated at each place along its line: profile under it, seat, index of its first point.
    fn seated<'a>(&'a self, height: &'a [f64]) -> impl Iterator<Item = (Profile, Seating, usize)> + 'a {
        let last = self.along.len() - 1;
        let step = self.along[last] / last as f64;
        let half = ((0.5 * self.chord / step).round() as usize).min(last / 2);
        let most = (last - half).max(half);
        let middles: Vec<usize> = match self.centre {
            Centre::At(centre) => vec![((centre / step).round() as usize).clamp(half, most)],
            Centre::Worst => (half..=most).step_by(SLIDE).chain([most]).collect(),
        };
        middles.into_iter().map(move |middle| {
            let (from, to) = (middle - half, (middle + half).min(last));
            let x = self.along[from..=to].iter().map(|s| s - self.along[middle]).collect();
            let profile = Profile { x, d: height[from..=to].to_vec() };
            let (seating, _) = profile.seat(self.seat, self.chord);
            (profile, seating, from)
        })
    }
}

/// Returns whether a seated template bridges the gap at a point, that is, the point lies between its outermost
/// contacts.
fn bridged(profile: &Profile, seating: &Seating) -> impl Fn(usize, f64) -> bool {
    let contacts = profile.contacts(seating);
    let (first, last) = (contacts.first().copied(), contacts.last().copied());
    move |point, gap| first < Some(point) && Some(point) < last && gap > 0.0
}
