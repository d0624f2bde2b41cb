//! Command `platen history advice`: compares the outcome of strokes with the advice before them.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use platen_advice::press_capability::{LEAST_STROKES, PressCapability, ram_scatter, without_short};
use platen_history::{Filter, Stroke};
use platen_model::CannotAdvise;
use platen_model::units::mm;
use platen_report::advice::{AdviceRecord, Score};
use platen_report::history_view;

use super::{CliError, Common, open, output};

#[derive(Debug, Args)]
pub(super) struct Command {
    /// Plant file
    plant: PathBuf,
    /// Only strokes of this plate, by its number in the history
    #[arg(long)]
    plate: Option<u32>,
    /// Number of strokes, the newest
    #[arg(long, default_value_t = 200)]
    newest: u32,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<(), CliError> {
    let (_, archive) = open(&command.plant)?;
    let filter = Filter { plate: command.plate, newest: Some(command.newest), ..Filter::default() };
    let mut scored = Vec::new();
    let mut rams = BTreeMap::new();
    let mut too_late = 0_usize;
    for stroke in archive.strokes(&filter)? {
        let Some(document) = &stroke.document else { continue };
        match AdviceRecord::beside(document) {
            Ok(Some(record)) => {
                Ram::add(&mut rams, &record);
                too_late += usize::from(record.unadvised == Some(CannotAdvise::TooLate));
                scored.extend(record.score.map(|score| (stroke, record.show, score)));
            }
            Ok(None) => {}
            Err(why) => tracing::warn!("{why}"),
        }
    }
    let shares = Shares::of(scored.iter().map(|(_, _, score)| score));
    if common.json {
        let strokes: Vec<_> = scored
            .iter()
            .map(|(stroke, show, score)| {
                serde_json::json!({ "run_id": stroke.run_id, "plate": stroke.plate, "show": show, "score": score })
            })
            .collect();
        return output::json(&serde_json::json!({
            "strokes": strokes,
            "angle_inside": shares.angle.share(), "angles": shares.angle.all,
            "gap_inside": shares.gap.share(), "gaps": shares.gap.all,
            "followed": shares.followed.share(), "too_late": too_late,
            "rams": rams.iter().map(|(die, ram)| ram.document(*die)).collect::<Vec<_>>(),
        }));
    }
    output::titled(
        "run | plate | stroke | shown | off the line mm | advised deg | expected of the depth deg | made deg | inside | gap expected mm | gap mm | inside | followed",
        scored.iter().map(|(stroke, show, score)| row(stroke, show, score)),
    )?;
    output::line(&format!(
        "angle of the reported depth inside its 95 % interval: {}; gap inside: {}; advice followed: {}; strokes made before their advice was ready: {too_late}",
        shares.angle.words(),
        shares.gap.words(),
        shares.followed.words()
    ))?;
    rams.iter().try_for_each(|(die, ram)| output::line(&ram.words(*die)))
}

/// Reached minus wanted depths over one die, and the template (board) that was last used there.
#[derive(Debug)]
struct Ram {
    offs: Vec<f64>,
    opening: f64,
    board: Option<(f64, f64)>,
}

impl Ram {
    /// Adds the stroke before this advice, if it was pressed as advised and the press reported its depth.
    fn add(rams: &mut BTreeMap<u16, Self>, record: &AdviceRecord) {
        let Some(die) = &record.history.die else { return };
        let ram = rams.entry(die.id).or_insert(Self { offs: Vec::new(), opening: die.opening, board: None });
        ram.opening = die.opening;
        ram.board =
            record.history.task.templates.first().map(|board| (board.chord, board.limit)).or(ram.board);
        let stroke = record.history.strokes.last();
        let wanted = stroke.and_then(|stroke| stroke.wanted.as_ref()?.depth);
        ram.offs.extend(
            stroke.and_then(|stroke| stroke.depth).zip(wanted).map(|(reported, wanted)| reported - wanted),
        );
    }

    fn capability(&self) -> Option<([f64; 3], PressCapability)> {
        let scatter = ram_scatter(&without_short(&self.offs))?;
        let (chord, limit) = self.board?;
        Some((scatter, PressCapability::new(scatter[1], self.opening, chord, limit)))
    }

    fn document(&self, die: u16) -> serde_json::Value {
        let capability = self.capability();
        serde_json::json!({
            "die": die, "strokes": without_short(&self.offs).len(), "ram_sigma_m": capability.map(|it| it.0[1]),
            "ram_sigma_95_m": capability.map(|it| [it.0[0], it.0[2]]),
            "gap_sigma_m": capability.map(|it| it.1.gap_sigma), "too_coarse": capability.map(|it| it.1.is_too_coarse()),
        })
    }

    fn words(&self, die: u16) -> String {
        let n = without_short(&self.offs).len();
        match self.capability() {
            Some(([low, _, high], press)) => {
                format!(
                    "die {die}: {} ({:.2} to {:.2} mm from {n} strokes)",
                    press.sentence().en,
                    mm(low),
                    mm(high)
                )
            }
            None => format!(
                "die {die}: what the press can hold is not known: {n} strokes pressed to an advised depth, {LEAST_STROKES} needed"
            ),
        }
    }
}

fn row(stroke: &Stroke, show: &str, score: &Score) -> Vec<String> {
    let word =
        |inside: Option<bool>| inside.map_or("", |inside| if inside { "yes" } else { "no" }).to_owned();
    let deg = |angle: f64| format!("{:.2}", angle.to_degrees());
    let [low, _, high] = score.foretold_gap.map(mm);
    vec![
        stroke.run_id.to_string(),
        stroke.plate.to_string(),
        history_view::label(stroke),
        show.to_owned(),
        format!("{:.0}", mm(score.off_line)),
        deg(score.advised_angle),
        score
            .expected_angle
            .zip(score.expected_to)
            .map_or_else(String::new, |(angle, to)| format!("{} +- {}", deg(angle), deg(to))),
        deg(score.made.angle.abs()),
        word(score.angle_inside()),
        format!("{low:.1} to {high:.1}"),
        output::number(score.gap.map(mm), 1),
        word(score.gap_inside()),
        word(Some(score.followed)),
    ]
}

/// Number of strokes inside the interval, and number of all strokes.
#[derive(Debug, Clone, Copy, Default)]
struct Count {
    inside: usize,
    all: usize,
}

impl Count {
    fn add(&mut self, inside: Option<bool>) {
        self.all += usize::from(inside.is_some());
        self.inside += usize::from(inside == Some(true));
    }

    fn share(self) -> Option<f64> {
        (self.all > 0).then(|| self.inside as f64 / self.all as f64)
    }

    fn words(self) -> String {
        self.share()
            .map_or_else(|| "no stroke".to_owned(), |share| format!("{:.0} % of {}", 100.0 * share, self.all))
    }
}

#[derive(Debug, Default)]
struct Shares {
    angle: Count,
    gap: Count,
    followed: Count,
}

impl Shares {
    fn of<'a>(scores: impl Iterator<Item = &'a Score>) -> Self {
        let mut shares = Self::default();
        for score in scores {
            shares.angle.add(score.angle_inside());
            shares.gap.add(score.gap_inside());
            shares.followed.add(Some(score.followed));
        }
        shares
    }
}
