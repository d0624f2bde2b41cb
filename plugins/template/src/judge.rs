//! What one board says: its gap, the uncertainty, the verdict and the sentence.

use platen_model::{Contact, Seat, Template, TemplateFinding, Verdict};
use platen_shape::{EXPANDED, Surface, TargetSurface};

use crate::seat::{Profile, Rest};
use crate::section::{Board, Line, Section};

/// A board whose edge rises less than this over its own chord counts as straight, metres: no template is cut finer.
const STRAIGHT: f64 = 0.1e-3;

/// Places under a board: 1 cm under one of 2 m.
const PLACES: usize = 201;

/// Places while the worst place is searched.
const SEARCH_PLACES: usize = 41;

/// Steps of the search, as a share of the chord.
const SEARCH_STEP: f64 = 0.0125;

/// The plate, its target and what is known of the scanner.
#[derive(Debug)]
pub(crate) struct Judge<'a> {
    pub(crate) now: &'a Surface,
    pub(crate) target: &'a TargetSurface,
    /// One sigma of a position, of a pair of scans.
    pub(crate) sigma_correlated: f64,
    /// One sigma, of a gap on a known artefact.
    pub(crate) sigma_true: f64,
}

/// A judged board with what belongs to it but does not cross the boundary in the finding.
#[derive(Debug)]
pub(crate) struct Judged {
    pub(crate) finding: TemplateFinding,
    /// How far the board can be tilted while it touches, radians.
    pub(crate) rocking: f64,
    /// Radius of the plate under the board, positive when its centre lies on the scanner's side.
    pub(crate) radius: Option<f64>,
    /// Sagitta of the plate under the board.
    pub(crate) sagitta: f64,
    /// Places of the gap profile.
    pub(crate) places: Vec<[f64; 2]>,
}

/// A board at rest and its largest gap.
struct Laid {
    section: Section,
    rest: Rest,
    rocks: bool,
    gaps: Vec<f64>,
    largest: usize,
}

/// Where the gap is open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Open {
    Between,
    Beyond,
}

impl Judge<'_> {
    /// Judges a board whose middle lies at `centre`.
    pub(crate) fn judge(&self, template: &Template, line: &Line, centre: f64) -> Judged {
        let board = Board { centre, chord: template.chord };
        let laid = self.lay(line, board, template.seat, PLACES);
        let place = |k: usize| line.at(laid.section.along[k]);
        let seen = |[u, v]: [f64; 2]| self.now.mask().seen(u, v);
        let contacts: Vec<Contact> = laid
            .section
            .profile
            .contacts(&laid.rest)
            .into_iter()
            .map(|k| Contact { at: place(k), seen: seen(place(k)) })
            .collect();
        let max_gap = laid.gaps[laid.largest];
        let max_gap_at = place(laid.largest);
        let uncertainty = self.uncertainty(line, &laid);

        let hidden = contacts.iter().find(|c| !c.seen).map(|c| ("the board touches", c.at));
        let hidden = hidden.or_else(|| (!seen(max_gap_at)).then_some(("the gap is largest", max_gap_at)));
        let verdict = match max_gap.abs() {
            _ if hidden.is_some() => Verdict::CannotTell,
            gap if gap + uncertainty <= template.limit => Verdict::Pass,
            gap if gap - uncertainty > template.limit => Verdict::Fail,
            _ => Verdict::CannotTell,
        };
        let (bent, sense) = self.sense(&laid);
        let open = format!("{:.1} mm open {}", max_gap.abs() * 1000.0, laid.where_open());
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
            seat: if laid.rocks { Seat::Balanced } else { template.seat },
            rocks: laid.rocks,
            max_gap,
            uncertainty,
            max_gap_at,
            contacts,
            start: laid.section.along[0],
            limit: template.limit,
            sense: if verdict == Verdict::Pass { 0 } else { sense },
            verdict,
            says,
            gap: laid.gaps.clone(),
        };
        Judged {
            finding,
            rocking: laid.section.profile.rocking(),
            radius: laid.section.radius(),
            sagitta: laid.section.sagitta,
            places: laid.section.along.iter().map(|s| line.at(*s)).collect(),
        }
    }

    /// Middle of the board with the largest gap, slid along the whole line, and that gap.
    pub(crate) fn worst(&self, line: &Line, chord: f64, seat: Seat) -> (f64, f64) {
        let (first, last) = (0.5 * chord, (line.length - 0.5 * chord).max(0.5 * chord));
        let n_steps = ((last - first) / (SEARCH_STEP * chord)).ceil() as usize;
        let mut worst = (first, f64::NEG_INFINITY);
        for k in 0..=n_steps {
            let centre = first + (last - first) * k as f64 / n_steps.max(1) as f64;
            let laid = self.lay(line, Board { centre, chord }, seat, SEARCH_PLACES);
            let gap = laid.gaps[laid.largest].abs();
            if gap > worst.1 {
                worst = (centre, gap);
            }
        }
        worst
    }

    fn lay(&self, line: &Line, board: Board, seat: Seat, n_places: usize) -> Laid {
        let section = Section::new(self.now, self.target, line, board, n_places);
        let profile = &section.profile;
        let (rest, rocks) = rest(profile, seat, board.chord);
        let gaps = profile.gaps(&rest);
        let largest =
            (0..gaps.len()).fold(0, |best, k| if gaps[k].abs() > gaps[best].abs() + TIE { k } else { best });
        Laid { rest, rocks, gaps, largest, section }
    }

    /// 95 % uncertainty of the largest gap: the fit's noise as it goes together at the places that decide the gap, the
    /// correlated error of a single scan taken as independent between those places, the scanner's own bias.
    fn uncertainty(&self, line: &Line, laid: &Laid) -> f64 {
        let terms: Vec<([f64; 2], f64)> = laid
            .section
            .profile
            .functional(&laid.rest, laid.largest)
            .into_iter()
            .map(|(k, weight)| {
                let [u, v] = line.at(laid.section.along[k]);
                ([u, v], weight / laid.section.upright(&self.now.normal(u, v)))
            })
            .collect();
        let square: f64 = terms.iter().map(|(_, w)| w * w).sum();
        let correlated = self.sigma_correlated * (0.5 * square).sqrt();
        EXPANDED * self.now.sigma_of_heights(&terms).hypot(correlated).hypot(self.sigma_true)
    }

    /// What the gap means, and -1 not bent enough or 1 bent too far. A board that bridges its gap lies on a plate that
    /// is more hollow than itself, one that overhangs it on one that is less.
    fn sense(&self, laid: &Laid) -> (&'static str, i8) {
        let hollow = laid.open() == Open::Between;
        let board = laid.section.target_sagitta;
        if board.abs() < STRAIGHT {
            return (if hollow { "hollow" } else { "crowned" }, 1);
        }
        if hollow == (board > 0.0) { ("bent too far", 1) } else { ("under-bent", -1) }
    }
}

/// Gaps closer than this are equal, metres: of two equal gaps the first counts, whatever the last bits say.
const TIE: f64 = 1e-9;

/// The seat that is judged, and whether the board rocks on the one that was asked for.
fn rest(profile: &Profile, seat: Seat, chord: f64) -> (Rest, bool) {
    match seat {
        Seat::Balanced => (profile.balanced(), profile.gravity().span(profile) < 0.25 * chord),
        Seat::Held => (profile.held(), false),
        Seat::Gravity => {
            let rest = profile.gravity();
            if rest.span(profile) < 0.25 * chord { (profile.balanced(), true) } else { (rest, false) }
        }
    }
}

impl Laid {
    fn open(&self) -> Open {
        let contacts = self.section.profile.contacts(&self.rest);
        let between = |k: usize| contacts.first() < Some(&k) && Some(&k) < contacts.last();
        // Under a held board, whose ends touch, the plate may also stand above the edge.
        match between(self.largest) && self.gaps[self.largest] > 0.0 {
            true => Open::Between,
            false => Open::Beyond,
        }
    }

    fn where_open(&self) -> &'static str {
        let gap = self.gaps[self.largest];
        let x = &self.section.profile.x;
        let half = 0.5 * (x[x.len() - 1] - x[0]);
        let ends = [self.gaps[0], self.gaps[self.gaps.len() - 1]];
        match self.open() {
            _ if gap < 0.0 => "above the board's edge",
            Open::Between if x[self.largest].abs() < 0.5 * half => "in the middle",
            Open::Between => "between its contacts",
            Open::Beyond if ends.iter().all(|end| *end > 0.5 * gap) => "at the ends",
            Open::Beyond => "at one end",
        }
    }
}

/// Where on the plate, in words: along the direction in which the line runs more.
fn from_edge(line: &Line, at: [f64; 2]) -> String {
    let [along_u, along_v] = line.direction();
    if along_u.abs() >= along_v.abs() {
        format!("{:.1} m from the left edge", at[0])
    } else {
        format!("{:.1} m from the bottom edge", at[1])
    }
}
