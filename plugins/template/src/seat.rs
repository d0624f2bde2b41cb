//! How a board comes to rest: contact in one dimension.
//!
//! x runs along the board from its middle, d is the plate above the board's edge, both metres. The board lies on the
//! plate from above along a + b x >= d(x); the gap is a + b x - d(x).

/// The plate above the board's edge.
#[derive(Debug, Clone)]
pub(crate) struct Profile {
    /// Growing, from one end of the board to the other, 0 at its middle.
    pub(crate) x: Vec<f64>,
    /// Height of the plate over the edge.
    pub(crate) d: Vec<f64>,
}

/// Where a board lies.
#[derive(Debug, Clone)]
pub(crate) struct Rest {
    offset: f64,
    tilt: f64,
    kind: Kind,
}

/// What holds the board: indices into the profile.
#[derive(Debug, Clone, Copy)]
enum Kind {
    /// It rests on two places.
    OnTwo([usize; 2]),
    /// Its ends have equal gaps, it touches in one place.
    Balanced(usize),
    /// Its ends are set on the profile.
    Held,
}

impl Profile {
    /// The line above d that is lowest at the middle of the board: the edge of d's upper hull over x = 0.
    pub(crate) fn gravity(&self) -> Rest {
        let hull = self.upper_hull();
        let right = hull.iter().position(|&i| self.x[i] > 0.0).unwrap_or(hull.len() - 1).max(1);
        let [i, j] = [hull[right - 1], hull[right]];
        let tilt = self.slope(i, j);
        Rest { offset: self.d[i] - tilt * self.x[i], tilt, kind: Kind::OnTwo([i, j]) }
    }

    /// Equal gaps at both ends.
    pub(crate) fn balanced(&self) -> Rest {
        let tilt = self.slope(0, self.last());
        let above = |i: usize| self.d[i] - tilt * self.x[i];
        let contact = (0..self.x.len()).fold(0, |best, i| if above(i) > above(best) { i } else { best });
        Rest { offset: above(contact), tilt, kind: Kind::Balanced(contact) }
    }

    /// Both ends set on the profile.
    pub(crate) fn held(&self) -> Rest {
        let tilt = self.slope(0, self.last());
        Rest { offset: self.d[0] - tilt * self.x[0], tilt, kind: Kind::Held }
    }

    /// Gap at every place; negative only under a held board.
    pub(crate) fn gaps(&self, rest: &Rest) -> Vec<f64> {
        self.x.iter().zip(&self.d).map(|(x, d)| rest.offset + rest.tilt * x - d).collect()
    }

    /// The gap at place `k` as a weighted sum of heights of the plate. Contacts are where the gap is smallest, so
    /// that it does not change to first order when they move.
    pub(crate) fn functional(&self, rest: &Rest, k: usize) -> Vec<(usize, f64)> {
        let share = |i: usize, j: usize, m: usize| (self.x[k] - self.x[m]) / (self.x[j] - self.x[i]);
        let (first, last) = (0, self.last());
        match rest.kind {
            Kind::OnTwo([i, j]) => {
                let f = share(i, j, i);
                vec![(i, 1.0 - f), (j, f), (k, -1.0)]
            }
            Kind::Balanced(m) => {
                let f = share(first, last, m);
                vec![(m, 1.0), (last, f), (first, -f), (k, -1.0)]
            }
            Kind::Held => {
                let f = share(first, last, first);
                vec![(first, 1.0 - f), (last, f), (k, -1.0)]
            }
        }
    }

    /// Places where the board touches.
    pub(crate) fn contacts(&self, rest: &Rest) -> Vec<usize> {
        match rest.kind {
            Kind::OnTwo(both) => both.to_vec(),
            Kind::Balanced(one) => vec![one],
            Kind::Held => vec![0, self.last()],
        }
    }

    /// How far the board can be tilted while it touches, rolled until one end touches and then the other: radians.
    pub(crate) fn rocking(&self) -> f64 {
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

    /// Upper convex hull (Andrew's monotone chain), from the first place to the last.
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

impl Rest {
    /// Distance between the contacts that the board lies on.
    pub(crate) fn span(&self, profile: &Profile) -> f64 {
        match self.kind {
            Kind::OnTwo([i, j]) => profile.x[j] - profile.x[i],
            Kind::Balanced(_) => 0.0,
            Kind::Held => profile.x[profile.last()] - profile.x[0],
        }
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
        let rest = p.gravity();
        assert_eq!(p.contacts(&rest), [0, 200]);
        assert!((rest.span(&p) - 2.0).abs() < 1e-12 && p.rocking() < 1e-12);
        assert!((p.gaps(&rest)[100] - 0.004).abs() < 1e-12);
    }

    #[test]
    fn on_a_hill_the_board_rocks_and_balances() {
        let p = profile(|x| -0.004 * x * x + 0.003 * x);
        assert!(p.gravity().span(&p) < 0.02);
        let rest = p.balanced();
        let gaps = p.gaps(&rest);
        assert_eq!(p.contacts(&rest), [100]);
        assert!((gaps[0] - 0.004).abs() < 1e-12 && (gaps[200] - 0.004).abs() < 1e-12);
        // From one end touching to the other: twice the slope of 2 * 0.004 at the ends, a half step short.
        assert!((p.rocking() - 2.0 * 0.008 * 0.995).abs() < 1e-12, "{}", p.rocking());
    }

    #[test]
    fn on_two_humps_the_board_lies_on_both() {
        // Humps of 5 mm at -0.4 and 2 mm at +0.7; the board over the middle lies on them.
        let hump = |x: f64, at: f64, height: f64| height * (-((x - at) / 0.05).powi(2)).exp();
        let p = profile(|x| hump(x, -0.4, 0.005) + hump(x, 0.7, 0.002));
        let rest = p.gravity();
        assert_eq!(p.contacts(&rest), [60, 170]);
        let at_middle = 0.005 - 0.003 * 0.4 / 1.1;
        assert!((p.gaps(&rest)[100] - at_middle).abs() < 1e-9);
    }

    #[test]
    fn the_plate_stands_above_a_held_board_with_a_sign() {
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
            for rest in [&gravity, &balanced] {
                assert!(p.gaps(rest).iter().all(|gap| *gap > -1e-12), "round {round}");
            }
            assert!(p.gaps(&gravity)[100] <= p.gaps(&balanced)[100] + 1e-12, "round {round}");
            let ends = p.gaps(&balanced);
            assert!((ends[0] - ends[200]).abs() < 1e-12);
            assert!(largest(&ends) >= 0.0);
        }
    }

    #[test]
    fn the_functional_is_the_gap_and_its_derivative() {
        let p = profile(|x| 0.003 * (4.0 * x).sin() - 0.002 * x * x);
        for rest in [p.gravity(), p.balanced(), p.held()] {
            let k = 37;
            let functional = p.functional(&rest, k);
            let sum: f64 = functional.iter().map(|(i, w)| w * p.d[*i]).sum();
            assert!((sum - p.gaps(&rest)[k]).abs() < 1e-15);
            // Constants and slopes are the board's own freedom.
            assert!(functional.iter().map(|(_, w)| w).sum::<f64>().abs() < 1e-12);
            assert!(functional.iter().map(|(i, w)| w * p.x[*i]).sum::<f64>().abs() < 1e-12);
        }
    }
}
