//! Comparison of crews: figures of how they bend plates of one class, corrected for the hardness of each plate.
//!
//! Masuda et al. name the comparison of skilled persons with beginners as future work. Plates can only be compared
//! within a class: target, thickness, grade, die. A plate counts for a crew if all its strokes were made by that crew
//! and its advice states the least number of strokes and the hardness. Advice that was not shown (`shadow`) is
//! sufficient.
//!
//! | figure of a plate | definition |
//! |---|---|
//! | excess | strokes to pass over the least number, the plan on the blank |
//! | turn efficiency | net bend angle over the sum of the sizes of all bend angles |
//! | evenness | coefficient of variation of the angles, of the feeds |
//! | idle hits | share of strokes that left no bend |
//! | hardness | offset of the depth law learned from the strokes, millimetres |
//!
//! The logarithm of the excess is fitted by least squares, with a mean for each crew and one slope over the hardness,
//! so that a crew with a hard heat of steel is not rated as a bad crew. Crews are compared in pairs with 95 % intervals
//! (Student), never ranked.
//!
//! Limits: below [`LEAST_PLATES`] plates nothing is reported about a crew. Plates of one heat are assumed to be
//! independent.

use std::collections::BTreeMap;

use platen_history::{Archive, Error as HistoryError, Filter};
use platen_model::units::mm;
use platen_model::{PressedStroke, Verdict};
use serde::Serialize;

use crate::advice::AdviceRecord;

/// Least number of plates of a crew and class.
pub const LEAST_PLATES: usize = 20;

/// A finished plate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlateSkill {
    /// Number in the history.
    pub plate: u32,
    /// Class in words.
    pub class: String,
    /// Code of the crew.
    pub crew: u16,
    /// Strokes to the first pass.
    pub strokes: usize,
    /// Least number of strokes.
    pub least: u32,
    /// Net bend angle over the sum of the sizes of all.
    pub turn_efficiency: Option<f64>,
    /// Coefficients of variation of angles and of feeds.
    pub unevenness: [Option<f64>; 2],
    /// Share of strokes that left no bend.
    pub idle_hits: f64,
    /// Offset of the depth law.
    pub hardness_mm: f64,
}

impl PlateSkill {
    /// Returns the number of strokes over the least number.
    #[must_use]
    pub fn excess(&self) -> f64 {
        self.strokes as f64 / f64::from(self.least)
    }
}

/// Crew in a class.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CrewSkill {
    /// Class in words.
    pub class: String,
    /// Code.
    pub crew: u16,
    /// Number of plates.
    pub plates: usize,
    /// Figures; null below [`LEAST_PLATES`].
    pub figures: Option<CrewFigures>,
}

/// Means over the plates of a crew.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CrewFigures {
    /// Geometric mean of the excess at the mean hardness of the class, with its 95 % interval.
    pub excess: [f64; 3],
    /// Net bend angle over the sum of the sizes of all.
    pub turn_efficiency: Option<f64>,
    /// Coefficients of variation of angles and of feeds.
    pub unevenness: [Option<f64>; 2],
    /// Share of strokes that left no bend.
    pub idle_hits: f64,
    /// Mean hardness.
    pub hardness_mm: f64,
}

/// Two crews of one class.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Class in words.
    pub class: String,
    /// Codes.
    pub crews: [u16; 2],
    /// Strokes of the first crew over those of the second at equal hardness, with the 95 % interval.
    pub ratio: [f64; 3],
}

impl Difference {
    /// Returns whether the interval does not contain 1.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        !(self.ratio[0]..=self.ratio[2]).contains(&1.0)
    }
}

/// Figures of the crews of a plant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Skill {
    /// Crews, by class and code.
    pub crews: Vec<CrewSkill>,
    /// Pairs of crews with figures.
    pub differences: Vec<Difference>,
    /// Finished plates that were left out: without a crew, of several crews, or without advice.
    pub left_out: usize,
}

impl Skill {
    /// Evaluates the finished plates of the record.
    ///
    /// # Errors
    /// The history cannot be read.
    pub fn of(archive: &Archive) -> Result<Self, HistoryError> {
        let (mut plates, mut left_out) = (Vec::new(), 0);
        for plate in archive.plates()? {
            match finished(archive, plate.plate)? {
                Finished::Not => {}
                Finished::Unknown => left_out += 1,
                Finished::Plate(skill) => plates.push(skill),
            }
        }
        Ok(Self { left_out, ..Self::of_plates(&plates) })
    }

    /// Compares the crews of these plates.
    #[must_use]
    pub fn of_plates(plates: &[PlateSkill]) -> Self {
        let mut classes: BTreeMap<&str, BTreeMap<u16, Vec<&PlateSkill>>> = BTreeMap::new();
        for plate in plates {
            classes.entry(&plate.class).or_default().entry(plate.crew).or_default().push(plate);
        }
        let mut skill = Self { crews: Vec::new(), differences: Vec::new(), left_out: 0 };
        for (class, crews) in classes {
            let enough: Vec<(u16, &Vec<&PlateSkill>)> = crews
                .iter()
                .filter(|(_, plates)| plates.len() >= LEAST_PLATES)
                .map(|(crew, plates)| (*crew, plates))
                .collect();
            let fit = Fit::new(&enough.iter().map(|(_, plates)| plates.as_slice()).collect::<Vec<_>>());
            for (&crew, plates) in &crews {
                let place = enough.iter().position(|(code, _)| *code == crew);
                let figures = place.zip(fit.as_ref()).map(|(place, fit)| figures(plates, fit.excess(place)));
                skill.crews.push(CrewSkill { class: class.to_owned(), crew, plates: plates.len(), figures });
            }
            for (i, j) in (0..enough.len()).flat_map(|i| (i + 1..enough.len()).map(move |j| (i, j))) {
                if let Some(fit) = &fit {
                    let crews = [enough[i].0, enough[j].0];
                    skill.differences.push(Difference {
                        class: class.to_owned(),
                        crews,
                        ratio: fit.ratio(i, j),
                    });
                }
            }
        }
        skill
    }
}

fn figures(plates: &[&PlateSkill], excess: [f64; 3]) -> CrewFigures {
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, n) = values.fold((0.0, 0), |(sum, n), value| (sum + value, n + 1));
        (n > 0).then(|| sum / f64::from(n))
    };
    let of =
        |figure: fn(&PlateSkill) -> Option<f64>| mean(&mut plates.iter().filter_map(|plate| figure(plate)));
    CrewFigures {
        excess,
        turn_efficiency: of(|plate| plate.turn_efficiency),
        unevenness: [of(|plate| plate.unevenness[0]), of(|plate| plate.unevenness[1])],
        idle_hits: of(|plate| Some(plate.idle_hits)).unwrap_or_default(),
        hardness_mm: of(|plate| Some(plate.hardness_mm)).unwrap_or_default(),
    }
}

/// Least squares of log excess: a mean for each crew and one slope over hardness.
#[derive(Debug)]
struct Fit {
    /// Number, mean log excess and mean hardness of each crew.
    crews: Vec<(f64, f64, f64)>,
    slope: f64,
    /// Variances of a single plate and of the slope.
    variance: f64,
    slope_variance: f64,
    /// Mean hardness of all.
    hardness: f64,
    student: f64,
}

impl Fit {
    fn new(crews: &[&[&PlateSkill]]) -> Option<Self> {
        let n: usize = crews.iter().map(|plates| plates.len()).sum();
        let freedom = n.checked_sub(crews.len() + 1).filter(|freedom| *freedom > 0)? as f64;
        let mean = |plates: &[&PlateSkill], of: fn(&PlateSkill) -> f64| {
            plates.iter().map(|plate| of(plate)).sum::<f64>() / plates.len() as f64
        };
        let means: Vec<_> = crews
            .iter()
            .map(|plates| {
                (plates.len() as f64, mean(plates, |p| p.excess().ln()), mean(plates, |p| p.hardness_mm))
            })
            .collect();
        let centred = || {
            let all = crews.iter().zip(&means);
            all.flat_map(|(plates, (_, y, q))| {
                plates.iter().map(move |p| (p.excess().ln() - y, p.hardness_mm - q))
            })
        };
        let (xy, xx) = centred().fold((0.0, 0.0), |(xy, xx), (y, q)| (xy + y * q, xx + q * q));
        // Plates of equal hardness do not determine the slope, and need none.
        let slope = if xx > 0.0 { xy / xx } else { 0.0 };
        let variance = centred().map(|(y, q)| (y - slope * q).powi(2)).sum::<f64>() / freedom;
        let hardness = means.iter().map(|(n, _, q)| n * q).sum::<f64>() / n as f64;
        Some(Self {
            crews: means,
            slope,
            variance,
            slope_variance: if xx > 0.0 { variance / xx } else { 0.0 },
            hardness,
            // Upper 2.5 % of Student's distribution, to 0.002 from 20 degrees of freedom on.
            student: 1.96 + 2.372 / freedom + 2.82 / (freedom * freedom),
        })
    }

    fn excess(&self, crew: usize) -> [f64; 3] {
        let (n, y, q) = self.crews[crew];
        let off = q - self.hardness;
        self.interval(y - self.slope * off, self.variance / n + self.slope_variance * off * off)
    }

    fn ratio(&self, a: usize, b: usize) -> [f64; 3] {
        let ((n, y, q), (m, z, r)) = (self.crews[a], self.crews[b]);
        let variance = self.variance * (1.0 / n + 1.0 / m) + self.slope_variance * (q - r).powi(2);
        self.interval(y - z - self.slope * (q - r), variance)
    }

    fn interval(&self, log: f64, variance: f64) -> [f64; 3] {
        let half = self.student * variance.sqrt();
        [log - half, log, log + half].map(f64::exp)
    }
}

enum Finished {
    /// It has not passed.
    Not,
    /// The figures cannot be determined.
    Unknown,
    Plate(PlateSkill),
}

fn finished(archive: &Archive, plate: u32) -> Result<Finished, HistoryError> {
    let strokes = archive.strokes(&Filter { plate: Some(plate), ..Filter::default() })?;
    let Some(passed) =
        strokes.iter().position(|it| !it.baseline && !it.dry_run && it.verdict == Some(Verdict::Pass))
    else {
        return Ok(Finished::Not);
    };
    let strokes: Vec<_> = strokes[..=passed].iter().filter(|it| !it.dry_run).collect();
    let bent: Vec<_> = strokes.iter().filter(|it| !it.baseline).collect();
    let record = |document: Option<&std::path::PathBuf>| AdviceRecord::beside(document?).ok().flatten();
    let first = strokes.iter().find_map(|it| record(it.document.as_ref()));
    let last = strokes.last().and_then(|it| record(it.document.as_ref()));
    let crews: Vec<Option<u16>> = bent.iter().map(|it| it.press_data().crew).collect();
    let one = crews.first().copied().flatten().filter(|crew| crews.iter().all(|other| *other == Some(*crew)));
    let least =
        first.filter(|first| first.baseline).and_then(|first| u32::try_from(first.advice?.plan.len()).ok());
    let model = last.as_ref().and_then(|last| last.advice.as_ref()?.model);
    let (Some(crew), Some(least), Some(model), Some(last)) =
        (one, least.filter(|least| *least > 0), model, last)
    else {
        return Ok(Finished::Unknown);
    };
    let pressed = &last.history.strokes;
    let angles: Vec<f64> = pressed.iter().filter_map(|it| Some(it.bends.first()?.angle)).collect();
    let sum: f64 = angles.iter().map(|angle| angle.abs()).sum();
    Ok(Finished::Plate(PlateSkill {
        plate,
        class: last.class.words(),
        crew,
        strokes: bent.len(),
        least,
        turn_efficiency: (sum > 0.0).then(|| angles.iter().sum::<f64>().abs() / sum),
        unevenness: [variation(&angles), variation(&feeds(pressed))],
        idle_hits: pressed.iter().filter(|it| it.bends.is_empty()).count() as f64
            / pressed.len().max(1) as f64,
        hardness_mm: mm(model.offset),
    }))
}

/// Returns the distances from each bend to the next one, across its line, metres.
fn feeds(strokes: &[PressedStroke]) -> Vec<f64> {
    let bends: Vec<_> = strokes.iter().filter_map(|it| it.bends.first()).collect();
    let feed = |pair: &[&platen_model::Bend]| {
        let (sin, cos) = pair[1].direction.sin_cos();
        (sin * (pair[1].at[0] - pair[0].at[0]) - cos * (pair[1].at[1] - pair[0].at[1])).abs()
    };
    bends.windows(2).map(feed).collect()
}

/// Returns the coefficient of variation of the sizes.
fn variation(values: &[f64]) -> Option<f64> {
    let n = values.len() as f64;
    let mean = values.iter().map(|value| value.abs()).sum::<f64>() / n;
    let square = values.iter().map(|value| (value.abs() - mean).powi(2)).sum::<f64>();
    (values.len() > 2 && mean > 0.0).then(|| (square / (n - 1.0)).sqrt() / mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns plates of a crew whose work scatters by 20 %, on steel of this mean hardness; each 0.1 mm of hardness
    /// costs 5 % more strokes.
    fn plates(random: &mut fastrand::Rng, crew: u16, hardness_mm: f64, skill: f64) -> Vec<PlateSkill> {
        let mut normal =
            || (-2.0 * (1.0 - random.f64()).ln()).sqrt() * (std::f64::consts::TAU * random.f64()).cos();
        (0..30)
            .map(|plate| {
                let hardness_mm = hardness_mm + 0.3 * normal();
                let excess = (skill + 0.5 * hardness_mm + 0.2 * normal()).exp();
                PlateSkill {
                    plate,
                    class: "cylinder".into(),
                    crew,
                    strokes: (1000.0 * excess) as usize,
                    least: 1000,
                    turn_efficiency: Some(1.0),
                    unevenness: [None, None],
                    idle_hits: 0.0,
                    hardness_mm,
                }
            })
            .collect()
    }

    fn significant(seed: u64, hardness_mm: f64, skill: f64) -> bool {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut all = plates(&mut random, 1, 0.0, 0.4);
        all.extend(plates(&mut random, 2, hardness_mm, 0.4 + skill));
        let skill = Skill::of_plates(&all);
        assert_eq!((skill.crews.len(), skill.differences.len()), (2, 1));
        skill.differences[0].is_significant()
    }

    /// Found: 5 of 100 pairs of equal crews differ significantly, and 98 of 100 pairs of which one needs 20 % more
    /// strokes.
    #[test]
    fn a_crew_with_a_hard_heat_is_no_bad_crew() {
        let equal = (0..100).filter(|seed| significant(*seed, 0.5, 0.0)).count();
        let worse = (0..100).filter(|seed| significant(*seed, 0.0, 0.2)).count();
        println!("{equal} of 100 equal crews, {worse} of 100 different ones");
        assert!(equal <= 10 && worse >= 90, "{equal} {worse}");
    }

    #[test]
    fn nothing_is_reported_of_few_plates() {
        let mut random = fastrand::Rng::with_seed(1);
        let mut all = plates(&mut random, 1, 0.0, 0.4);
        all.extend(plates(&mut random, 2, 0.0, 0.4).into_iter().take(LEAST_PLATES - 1));
        let skill = Skill::of_plates(&all);
        assert!(skill.differences.is_empty());
        assert!(skill.crews[0].figures.is_some() && skill.crews[1].figures.is_none());
    }
}
