//! Evaluation of one template: gap, uncertainty, verdict and sentence.

use platen_model::{Centre, Contact, Seat, Template, TemplateFinding, Verdict};
use platen_shape::template_seat::Seating;
use platen_shape::{EXPANDED, Surface, TargetSurface};

use crate::scanner_sigma::ScannerSigma;
use crate::section::{Chord, Line, Section};
use crate::trials::{TRIALS, Trials, half_width};

/// A template with a smaller sagitta counts as straight, metres: no template is cut more precisely.
const STRAIGHT: f64 = 0.1e-3;

/// Number of points under a template: 1 cm apart for a chord of 2 m.
pub(crate) const PLACES: usize = 201;

/// Number of points under a template that is slid over the whole plate for a figure without a verdict.
pub(crate) const FEW_PLACES: usize = 41;

/// Step of the search as a share of the chord.
const SEARCH_STEP: f64 = 0.0125;

/// Distances from the worst position, in steps of the search, at which it is searched more finely, and beside it in
/// each trial.
const FINE: [f64; 5] = [0.2, 0.4, 0.6, 0.8, 1.0];
const BESIDE: [f64; 8] = [0.2, 0.4, 0.6, 0.8, 1.0, 2.0, 3.0, 4.0];

/// Plate, target and the scanner's errors.
#[derive(Debug)]
pub(crate) struct Evaluator<'a> {
    pub(crate) now: &'a Surface,
    pub(crate) target: &'a TargetSurface,
    pub(crate) scanner: ScannerSigma,
    pub(crate) trials: &'a Trials<'a>,
}

/// Finding of a template, with the figures that the finding does not contain.
#[derive(Debug)]
pub(crate) struct Evaluated {
    pub(crate) finding: TemplateFinding,
    /// Range of tilts at which the template touches the plate, radians.
    pub(crate) rocking: f64,
    /// Radius of the plate under the template, positive when its centre lies on the scanner's side.
    pub(crate) radius: Option<f64>,
    /// Sagitta of the plate under the template.
    pub(crate) sagitta: f64,
    /// Points of the gap profile.
    pub(crate) places: Vec<[f64; 2]>,
    line: Line,
    seated: Seated,
    tried: [TriedGaps; TRIALS],
}

/// Gaps of a trial.
#[derive(Debug)]
struct TriedGaps {
    /// Positions of the gaps along the line, metres.
    along: Vec<f64>,
    gaps: Vec<f64>,
    /// Size of the largest gap.
    largest: f64,
}

/// A template in its seat, with its gaps.
#[derive(Debug)]
struct Seated {
    section: Section,
    seating: Seating,
    rocks: bool,
    gaps: Vec<f64>,
    largest: usize,
}

/// Position of the largest gap relative to the contacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Opening {
    BetweenContacts,
    BeyondContacts,
}

impl Evaluator<'_> {
    /// Evaluates a template on its line.
    pub(crate) fn evaluate(&self, template: &Template, line: &Line, centre: Centre) -> Evaluated {
        let centres = match centre {
            Centre::At(centre) => vec![centre],
            Centre::Worst => {
                let worst = self.worst_finely(line, template.chord, template.seat);
                std::iter::once(worst).chain(beside(line, template.chord, worst, &BESIDE)).collect()
            }
        };
        let chord = Chord { centre: centres[0], length: template.chord };
        let seated = self.seat(line, chord, template.seat, PLACES);
        let place = |k: usize| line.at(seated.section.along[k]);
        let seen = |[u, v]: [f64; 2]| self.now.mask().seen(u, v);
        let contacts: Vec<Contact> = seated
            .section
            .profile
            .contacts(&seated.seating)
            .into_iter()
            .map(|k| Contact { at: place(k), seen: seen(place(k)) })
            .collect();
        let max_gap = seated.gaps[seated.largest];
        let max_gap_at = place(seated.largest);
        let tried = self.try_seats(template, line, &centres);
        let departures = std::array::from_fn(|k| tried[k].largest - max_gap.abs());
        let uncertainty = self.uncertainty(line, &seated, seated.largest, departures);

        let hidden = contacts.iter().find(|c| !c.seen).map(|c| ("the board touches", c.at));
        let hidden = hidden.or_else(|| (!seen(max_gap_at)).then_some(("the gap is largest", max_gap_at)));
        let verdict = match max_gap.abs() {
            _ if hidden.is_some() => Verdict::CannotTell,
            gap if gap + uncertainty <= template.limit => Verdict::Pass,
            gap if gap - uncertainty > template.limit => Verdict::Fail,
            _ => Verdict::CannotTell,
        };
        let (bent, sense) = self.sense(&seated);
        let open = format!("{:.1} mm open {}", max_gap.abs() * 1000.0, seated.where_open());
        let from_edge = from_edge(line, max_gap_at);
        let limit = template.limit * 1000.0;
        let says = match (verdict, hidden) {
            (_, Some((what, at))) => format!(
                "cannot tell: {what} {} where the plate was not seen; clear that place and scan again",
                self::from_edge(line, at)
            ),
            (Verdict::Pass, _) => format!("enough: {open}, limit {limit:.1} mm"),
            (Verdict::Fail, _) => format!("{bent}: {open}, {from_edge}"),
            _ => format!(
                "cannot tell: {open}, known to {:.1} mm, limit {limit:.1} mm, {from_edge}",
                (uncertainty * 1000.0).max(0.1)
            ),
        };
        let finding = TemplateFinding {
            name: template.name.clone(),
            line: line.name.clone(),
            seat: if seated.rocks { Seat::Balanced } else { template.seat },
            rocks: seated.rocks,
            max_gap,
            uncertainty,
            max_gap_at,
            contacts,
            start: seated.section.along[0],
            limit: template.limit,
            sense: if verdict == Verdict::Pass { 0 } else { sense },
            verdict,
            says,
            gap: seated.gaps.clone(),
        };
        Evaluated {
            finding,
            rocking: seated.section.profile.rocking(),
            radius: seated.section.radius(),
            sagitta: seated.section.sagitta,
            places: seated.section.along.iter().map(|s| line.at(*s)).collect(),
            line: line.clone(),
            seated,
            tried,
        }
    }

    /// Returns the gap at a point of the profile with its 95 % uncertainty, metres.
    pub(crate) fn gap_at(&self, evaluated: &Evaluated, place: usize) -> [f64; 2] {
        let Evaluated { line, seated, tried, .. } = evaluated;
        let (gap, at) = (seated.gaps[place], seated.section.along[place]);
        let departures = std::array::from_fn(|k| tried[k].at(at) - gap);
        [gap, self.uncertainty(line, seated, place, departures)]
    }

    /// Slides a template along the whole line; returns the middle of the position with the largest gap, and that gap.
    /// If a template is about to rock, fewer points than [`PLACES`] may show it at rest.
    pub(crate) fn worst(&self, line: &Line, chord: f64, seat: Seat, n_places: usize) -> (f64, f64) {
        let (first, last) = (0.5 * chord, (line.length - 0.5 * chord).max(0.5 * chord));
        let n_steps = ((last - first) / (SEARCH_STEP * chord)).ceil() as usize;
        let centres = (0..=n_steps).map(|k| first + (last - first) * k as f64 / n_steps.max(1) as f64);
        self.worst_of(centres, line, chord, seat, n_places, (first, f64::NEG_INFINITY))
    }

    /// Returns the middle of the position with the largest gap, refined between the steps of [`Self::worst`]. There the
    /// gap grows until the template falls on another contact.
    fn worst_finely(&self, line: &Line, chord: f64, seat: Seat) -> f64 {
        let worst = self.worst(line, chord, seat, PLACES);
        self.worst_of(beside(line, chord, worst.0, &FINE), line, chord, seat, PLACES, worst).0
    }

    /// Returns the centre with the largest gap, and the gap; `worst` if no centre has a larger one.
    fn worst_of(
        &self,
        centres: impl Iterator<Item = f64>,
        line: &Line,
        length: f64,
        seat: Seat,
        n_places: usize,
        worst: (f64, f64),
    ) -> (f64, f64) {
        let gaps = centres.map(|centre| {
            let seated = self.seat(line, Chord { centre, length }, seat, n_places);
            (centre, seated.gaps[seated.largest].abs())
        });
        gaps.fold(worst, |worst, next| if next.1 > worst.1 { next } else { worst })
    }

    fn seat(&self, line: &Line, chord: Chord, seat: Seat, n_places: usize) -> Seated {
        let section = Section::new(self.now, self.target, line, chord, n_places);
        let profile = &section.profile;
        let (seating, rocks) = profile.seat(seat, chord.length);
        let gaps = profile.gaps(&seating);
        Seated { seating, rocks, largest: largest(&gaps), gaps, section }
    }

    /// Returns the 95 % uncertainty of the gap at a point. In this seat it consists of the fit's covariance at the
    /// points that determine the gap, of the correlated error of a single scan, assumed to be independent between those
    /// points, and of the scanner's bias. It is at least that of the trials, of which `departures` are the differences
    /// of the gap. If the template is about to rock, or to fall on another contact, the gap jumps, and the weights do
    /// not show the other side of the jump.
    fn uncertainty(&self, line: &Line, seated: &Seated, place: usize, departures: [f64; TRIALS]) -> f64 {
        let term = |(k, weight): (usize, f64)| {
            let [u, v] = line.at(seated.section.along[k]);
            ([u, v], weight / seated.section.cosine(&self.now.normal(u, v)))
        };
        let functional = seated.section.profile.functional(&seated.seating, place);
        let terms: Vec<([f64; 2], f64)> = functional.into_iter().map(term).collect();
        let scanner = self.scanner.of_heights(terms.iter().map(|(_, weight)| *weight));
        let in_seat = EXPANDED * self.now.sigma_of_heights(&terms).hypot(scanner);
        in_seat.max(half_width(departures).hypot(EXPANDED * self.scanner.of_gap()))
    }

    /// Returns the gaps of the trials, in each with the template at the centre where its gap is largest: for a template
    /// that slides along its line, noise changes the worst position rather than the seat.
    fn try_seats(&self, template: &Template, line: &Line, centres: &[f64]) -> [TriedGaps; TRIALS] {
        let mut tried = std::array::from_fn(|_| TriedGaps {
            along: Vec::new(),
            gaps: Vec::new(),
            largest: f64::NEG_INFINITY,
        });
        for &centre in centres {
            let chord = Chord { centre, length: template.chord };
            let section = Section::new(self.now, self.target, line, chord, PLACES);
            let raised = section.along.iter().map(|s| {
                let [u, v] = line.at(*s);
                let cosine = section.cosine(&self.now.normal(u, v));
                self.trials.heights([u, v]).map(|height| height / cosine)
            });
            let raised: Vec<[f64; TRIALS]> = raised.collect();
            let mut plate = section.profile.clone();
            for (k, tried) in tried.iter_mut().enumerate() {
                let measured = section.profile.d.iter().zip(&raised);
                plate.d.clear();
                plate.d.extend(measured.map(|(height, raised)| height + raised[k]));
                let (seating, _) = plate.seat(template.seat, template.chord);
                let gaps = plate.gaps(&seating);
                let largest = gaps[largest(&gaps)].abs();
                if largest > tried.largest {
                    *tried = TriedGaps { along: section.along.clone(), gaps, largest };
                }
            }
        }
        tried
    }

    /// Returns the meaning of the gap and its sense: -1 not bent enough, 1 bent too far. If the template bridges the
    /// gap, the plate is more hollow than the template; if the template overhangs the gap, the plate is less hollow.
    fn sense(&self, seated: &Seated) -> (&'static str, i8) {
        let hollow = seated.open() == Opening::BetweenContacts;
        let sagitta = seated.section.target_sagitta;
        if sagitta.abs() < STRAIGHT {
            return (if hollow { "hollow" } else { "crowned" }, 1);
        }
        if hollow == (sagitta > 0.0) { ("bent too far", 1) } else { ("under-bent", -1) }
    }
}

impl TriedGaps {
    /// Returns the gap at the point nearest to a distance along the line, metres; `NaN` on a plate without finite
    /// heights.
    fn at(&self, distance: f64) -> f64 {
        let after = self.along.partition_point(|s| *s < distance);
        let nearest = match after {
            0 => 0,
            _ if after == self.along.len() => after - 1,
            _ if self.along[after] - distance < distance - self.along[after - 1] => after,
            _ => after - 1,
        };
        self.gaps.get(nearest).copied().unwrap_or(f64::NAN)
    }
}

/// Returns the centres at these distances to either side of the worst one, in steps of the search.
fn beside(line: &Line, chord: f64, worst: f64, steps: &[f64]) -> impl Iterator<Item = f64> {
    let (first, last) = (0.5 * chord, line.length - 0.5 * chord);
    let steps = steps.iter().flat_map(|step| [-step, *step]);
    steps
        .map(move |step| worst + step * SEARCH_STEP * chord)
        .filter(move |centre| (first..=last).contains(centre))
}

/// Gaps that differ by less than this count as equal, metres: the first of equal gaps is taken, independent of
/// rounding.
const TIE: f64 = 1e-9;

fn largest(gaps: &[f64]) -> usize {
    (0..gaps.len()).fold(0, |best, k| if gaps[k].abs() > gaps[best].abs() + TIE { k } else { best })
}

impl Seated {
    fn open(&self) -> Opening {
        let contacts = self.section.profile.contacts(&self.seating);
        let between = |k: usize| contacts.first() < Some(&k) && Some(&k) < contacts.last();
        // Under a held template, whose ends touch, the plate may also rise above the edge.
        match between(self.largest) && self.gaps[self.largest] > 0.0 {
            true => Opening::BetweenContacts,
            false => Opening::BeyondContacts,
        }
    }

    fn where_open(&self) -> &'static str {
        let gap = self.gaps[self.largest];
        let x = &self.section.profile.x;
        let half = 0.5 * (x[x.len() - 1] - x[0]);
        let ends = [self.gaps[0], self.gaps[self.gaps.len() - 1]];
        match self.open() {
            _ if gap < 0.0 => "above the board's edge",
            Opening::BetweenContacts if x[self.largest].abs() < 0.5 * half => "in the middle",
            Opening::BetweenContacts => "between its contacts",
            Opening::BeyondContacts if ends.iter().all(|end| *end > 0.5 * gap) => "at the ends",
            Opening::BeyondContacts => "at one end",
        }
    }
}

/// Returns the position as text, along the direction in which the line mainly runs.
fn from_edge(line: &Line, at: [f64; 2]) -> String {
    let [along_u, along_v] = line.direction();
    if along_u.abs() >= along_v.abs() {
        format!("{:.1} m from the left edge", at[0])
    } else {
        format!("{:.1} m from the bottom edge", at[1])
    }
}
