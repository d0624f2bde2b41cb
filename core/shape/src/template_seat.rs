//! Seat of a template: one-sided contact of a rigid edge with a profile.
//!
//! In: the profile d(x). x runs along the template from its middle, d is the height of the plate over the template's
//! edge, both in metres. Out: the seat, a line a + b x, and the gaps a + b x - d(x).
//!
//! - Gravity seat: the template rests on the plate from above, a + b x >= d(x), with the least a. This linear program
//!   in two unknowns has an edge of the upper convex hull of d as its solution.
//!   It rocks, and the balanced seat is judged, when its contacts span less than a quarter of the chord; where it lies
//!   flush beyond them, the flush part counts.
//! - Balanced seat: one contact, with equal gaps at both ends.
//! - Held seat: both ends are set on the profile; gaps may be negative.

use platen_model::Seat;

/// Height profile of the plate over the template's edge.
#[derive(Debug, Clone)]
pub struct Profile {
    /// Places along the template, increasing from one end to the other, 0 at its middle.
    pub x: Vec<f64>,
    /// Height of the plate over the edge at each x.
    pub d: Vec<f64>,
}

/// Position of a template on a profile: the line offset + tilt x.
#[derive(Debug, Clone)]
pub struct Seating {
    offset: f64,
    tilt: f64,
    support: Support,
}

/// Support of the template: indices into the profile.
#[derive(Debug, Clone, Copy)]
enum Support {
    /// Two contacts.
    OnTwo([usize; 2]),
    /// One contact, equal gaps at the ends.
    Balanced(usize),
    /// Both ends set on the profile.
    Held,
}

/// Share of the chord that the contacts must span; with a smaller span the template rocks.
const ROCKS: f64 = 0.25;
/// Largest gap at which a template or a target counts as touching, metres. On a part of its own shape it lies flush and
/// touches all of it, but the linear program returns any two or three of these places.
pub const TOUCHES: f64 = 10e-6;
/// Allowance for rounding, metres: contacts lie on a grid, so that their span often equals that share exactly.
const ROUNDING: f64 = 1e-9;

impl Profile {
    /// Returns the seating to be judged of a template `chord` metres long, and whether the template rocks in the
    /// gravity seat. Where it rocks, the balanced seat is judged.
    #[must_use]
    pub fn seat(&self, seat: Seat, chord: f64) -> (Seating, bool) {
        let rocks = |gravity: &Seating| self.span(gravity) < ROCKS * chord - ROUNDING;
        match seat {
            Seat::Balanced => (self.balanced(), rocks(&self.gravity())),
            Seat::Held => (self.held(), false),
            Seat::Gravity => {
                let gravity = self.gravity();
                if rocks(&gravity) { (self.balanced(), true) } else { (gravity, false) }
            }
        }
    }

    /// Returns the gravity seat: the line above d that is lowest at x = 0, which is the edge of the upper hull of d
    /// over x = 0. Where a contact at x = 0 itself ends two such edges the shorter one is selected, so that a mirrored
    /// profile has the mirrored seat.
    #[must_use]
    pub fn gravity(&self) -> Seating {
        let hull = self.upper_hull();
        let length = |right: usize| self.x[hull[right]] - self.x[hull[right - 1]];
        let mut right = hull.iter().position(|&i| self.x[i] > 0.0).unwrap_or(hull.len() - 1).max(1);
        if right > 1 && self.x[hull[right - 1]] == 0.0 && length(right - 1) < length(right) {
            right -= 1;
        }
        let [i, j] = [hull[right - 1], hull[right]];
        let tilt = self.slope(i, j);
        Seating { offset: self.d[i] - tilt * self.x[i], tilt, support: Support::OnTwo([i, j]) }
    }

    /// Returns the balanced seat: equal gaps at both ends.
    #[must_use]
    pub fn balanced(&self) -> Seating {
        let tilt = self.slope(0, self.last());
        let above = |i: usize| self.d[i] - tilt * self.x[i];
        let contact = (0..self.x.len()).fold(0, |best, i| if above(i) > above(best) { i } else { best });
        Seating { offset: above(contact), tilt, support: Support::Balanced(contact) }
    }

    /// Returns the held seat: both ends set on the profile.
    #[must_use]
    pub fn held(&self) -> Seating {
        let tilt = self.slope(0, self.last());
        Seating { offset: self.d[0] - tilt * self.x[0], tilt, support: Support::Held }
    }

    /// Returns the gap at every place; negative only in the held seat.
    #[must_use]
    pub fn gaps(&self, seating: &Seating) -> Vec<f64> {
        self.x.iter().zip(&self.d).map(|(x, d)| seating.offset + seating.tilt * x - d).collect()
    }

    /// Returns the gap at place `k` as a weighted sum of heights of the plate: (place, weight), each place once. The
    /// gap is smallest at the contacts; to first order it does not change when they move.
    #[must_use]
    pub fn functional(&self, seating: &Seating, k: usize) -> Vec<(usize, f64)> {
        let share = |i: usize, j: usize, m: usize| (self.x[k] - self.x[m]) / (self.x[j] - self.x[i]);
        let (first, last) = (0, self.last());
        let terms = match seating.support {
            Support::OnTwo([i, j]) => {
                let f = share(i, j, i);
                vec![(i, 1.0 - f), (j, f), (k, -1.0)]
            }
            Support::Balanced(m) => {
                let f = share(first, last, m);
                vec![(m, 1.0), (last, f), (first, -f), (k, -1.0)]
            }
            Support::Held => {
                let f = share(first, last, first);
                vec![(first, 1.0 - f), (last, f), (k, -1.0)]
            }
        };
        let mut functional: Vec<(usize, f64)> = Vec::with_capacity(terms.len());
        for (place, weight) in terms {
            match functional.iter_mut().find(|(known, _)| *known == place) {
                Some((_, sum)) => *sum += weight,
                None => functional.push((place, weight)),
            }
        }
        functional
    }

    /// Returns the places where the template touches.
    #[must_use]
    pub fn contacts(&self, seating: &Seating) -> Vec<usize> {
        match seating.support {
            Support::OnTwo(both) => both.to_vec(),
            Support::Balanced(one) => vec![one],
            Support::Held => vec![0, self.last()],
        }
    }

    /// Returns the distance between the contacts, and farther where the template lies flush beyond them.
    #[must_use]
    pub fn span(&self, seating: &Seating) -> f64 {
        let gaps = self.gaps(seating);
        let flush = |place: &usize| gaps[*place].abs() <= TOUCHES;
        let contacts = self.contacts(seating);
        let (first, last) = (contacts[0], contacts[contacts.len() - 1]);
        let first = (0..=first).rev().take_while(flush).last().unwrap_or(first);
        let last = (last..self.x.len()).take_while(flush).last().unwrap_or(last);
        self.x[last] - self.x[first]
    }

    /// Returns the range of tilts of the touching template, from contact at one end to contact at the other, radians.
    #[must_use]
    pub fn rocking(&self) -> f64 {
        let hull = self.upper_hull();
        let n = hull.len();
        self.slope(hull[0], hull[1]) - self.slope(hull[n - 2], hull[n - 1])
    }

    fn last(&self) -> usize {
        self.x.len() - 1
    }

    fn slope(&self, i: usize, j: usize) -> f64 {
        (self.d[j] - self.d[i]) / (self.x[j] - self.x[i])
    }

    /// Returns the upper convex hull from the first place to the last (Andrew's monotone chain).
    fn upper_hull(&self) -> Vec<usize> {
        let mut hull: Vec<usize> = Vec::new();
        for i in 0..self.x.len() {
            while let [.., a, b] = hull[..]
                && self.slope(a, b) <= self.slope(b, i)
            {
                hull.pop();
            }
            hull.push(i);
        }
        hull
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(f: impl Fn(f64) -> f64) -> Profile {
        let x: Vec<f64> = (0..201).map(|k| f64::from(k - 100) / 100.0).collect();
        Profile { d: x.iter().map(|x| f(*x)).collect(), x }
    }

    fn largest(gaps: &[f64]) -> f64 {
        gaps.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    #[test]
    fn on_a_hollow_the_ends_touch_and_the_middle_is_open() {
        let p = profile(|x| 0.004 * x * x + 0.01 * x);
        let seating = p.gravity();
        assert_eq!(p.contacts(&seating), [0, 200]);
        assert!((p.span(&seating) - 2.0).abs() < 1e-12 && p.rocking() < 1e-12);
        assert!((p.gaps(&seating)[100] - 0.004).abs() < 1e-12);
    }

    #[test]
    fn on_a_hill_the_template_rocks_and_balances() {
        let p = profile(|x| -0.004 * x * x + 0.003 * x);
        assert!(p.span(&p.gravity()) < 0.11);
        let seating = p.balanced();
        let gaps = p.gaps(&seating);
        assert_eq!(p.contacts(&seating), [100]);
        assert!((gaps[0] - 0.004).abs() < 1e-12 && (gaps[200] - 0.004).abs() < 1e-12);
        // From contact at one end to contact at the other: twice the slope of 2 * 0.004 at the ends, half a step short.
        assert!((p.rocking() - 2.0 * 0.008 * 0.995).abs() < 1e-12, "{}", p.rocking());
    }

    /// A plate bent to the template's radius within a micrometre up to a place right of the middle, and less beyond it.
    #[test]
    fn flush_on_a_part_of_its_own_shape_the_template_does_not_rock() {
        let beyond = |x: f64| (x - 0.3).max(0.0);
        let nearly = profile(|x| -0.2 * beyond(x).powi(2) - 1e-6 * x * x);
        let (seating, rocks) = nearly.seat(Seat::Gravity, 2.0);
        let gap = largest(&nearly.gaps(&seating));
        assert!(!rocks);
        assert!((gap - 0.2 * 0.7_f64.powi(2)).abs() < 2e-6, "{gap}");
        // With a hill of half a millimetre in place of the flush part it rocks.
        let hill = profile(|x| -0.2 * beyond(x).powi(2) - 5e-4 * x * x);
        assert!(hill.seat(Seat::Gravity, 2.0).1);
    }

    #[test]
    fn on_two_humps_the_template_lies_on_both() {
        // Humps of 5 mm at -0.4 and 2 mm at +0.7; the template over the middle lies on them.
        let hump = |x: f64, at: f64, height: f64| height * (-((x - at) / 0.05).powi(2)).exp();
        let p = profile(|x| hump(x, -0.4, 0.005) + hump(x, 0.7, 0.002));
        let seating = p.gravity();
        assert_eq!(p.contacts(&seating), [60, 170]);
        let at_middle = 0.005 - 0.003 * 0.4 / 1.1;
        assert!((p.gaps(&seating)[100] - at_middle).abs() < 1e-9);
    }

    #[test]
    fn the_plate_stands_above_a_held_template_with_a_sign() {
        let p = profile(|x| 0.003 * (1.0 - x * x) + 0.02 * x);
        let gaps = p.gaps(&p.held());
        assert!((gaps[100] + 0.003).abs() < 1e-12 && gaps[0].abs() < 1e-12 && gaps[200].abs() < 1e-12);
    }

    #[test]
    fn no_seat_goes_through_the_plate_and_gravity_is_lowest_in_the_middle() {
        let mut random = fastrand::Rng::with_seed(11);
        for round in 0..200 {
            let waves: Vec<[f64; 3]> =
                (0..4).map(|_| [random.f64() * 6.0, random.f64() * 6.0, random.f64() * 2e-3]).collect();
            let p = profile(|x| waves.iter().map(|[f, at, size]| size * (f * x + at).sin()).sum());
            let (gravity, balanced) = (p.gravity(), p.balanced());
            for seating in [&gravity, &balanced] {
                assert!(p.gaps(seating).iter().all(|gap| *gap > -1e-12), "round {round}");
            }
            assert!(p.gaps(&gravity)[100] <= p.gaps(&balanced)[100] + 1e-12, "round {round}");
            let ends = p.gaps(&balanced);
            assert!((ends[0] - ends[200]).abs() < 1e-12);
            assert!(largest(&ends) >= 0.0);
        }
    }

    #[test]
    fn the_gap_at_an_end_of_a_balanced_template_is_half_a_second_difference() {
        let p = profile(|x| -0.004 * x * x);
        let functional = p.functional(&p.balanced(), 200);
        let weight = |k: usize| functional.iter().find(|(place, _)| *place == k).map(|(_, weight)| *weight);
        assert_eq!([weight(0), weight(100), weight(200)], [Some(-0.5), Some(1.0), Some(-0.5)]);
        assert_eq!(functional.len(), 3);
    }

    #[test]
    fn the_functional_is_the_gap_and_its_derivative() {
        let p = profile(|x| 0.003 * (4.0 * x).sin() - 0.002 * x * x);
        for seating in [p.gravity(), p.balanced(), p.held()] {
            let k = 37;
            let functional = p.functional(&seating, k);
            let sum: f64 = functional.iter().map(|(i, w)| w * p.d[*i]).sum();
            assert!((sum - p.gaps(&seating)[k]).abs() < 1e-15);
            // Constants and slopes of the profile do not change a gap.
            assert!(functional.iter().map(|(_, w)| w).sum::<f64>().abs() < 1e-12);
            assert!(functional.iter().map(|(i, w)| w * p.x[*i]).sum::<f64>().abs() < 1e-12);
        }
    }
}
