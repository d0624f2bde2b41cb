//! Command `platen calibrate`: correlated and systematic errors of a scanner, estimated from repeated scans of one
//! plate.
//!
//! Two scans of an unbent plate (a null pair) differ by noise, which every scan states, and by errors that are
//! correlated over the plate.
//!
//! - `sigma_correlated` is the error with which 5 % of the area of all null pairs lies above the level of detection,
//!   which is the nominal rate.
//! - `sigma_true` needs an artefact of known shape. It is the systematic error with which the stated uncertainty covers
//!   95 % of the gaps under templates on it.
//!
//! Formulas: `platen_shape::inspection::calibration`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use jiff::Timestamp;
use platen_engine::calibration::Calibration;
use platen_engine::pipeline::Pipeline;
use platen_engine::plugin::{PluginError, Surfaces};
use platen_engine::stroke::{Baseline, PreviousPose};
use platen_model::units::mm;
use platen_plant::{PlantFile, PlateFile, PluginUse};
use platen_report::output_folder;
use platen_shape::inspection::calibration::{ArtefactGap, Pooled, artefact_gaps, covering};
use platen_shape::{Surface, TargetSurface};

use super::{CliError, Common, measure, output};
use crate::progress;

use serde::Serialize;

/// Largest plausible difference between scans of an untouched plate, one sigma, metres. Above it the plate was bent or
/// moved on its supports.
const NULL_LIMIT: f64 = 2e-3;

/// Share of an unchanged plate above the level of detection: that of 1.96 standard deviations.
const NOMINAL: f64 = 0.05;

/// Fewest pairs of a stable estimate: with fewer it scatters by a quarter or more.
const FEW_PAIRS: usize = 6;

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  platen calibrate plant.toml 1.e57 2.e57 3.e57 4.e57 --plate plates/plate-017.toml\n  \
                        platen calibrate plant.toml 1.e57 2.e57 3.e57 4.e57 --plate granite.toml --artefact\n\n\
                        Scan one plate several times without bending it, moved by some decimetres as by strokes: an error that depends on \
                        the range is the same in scans of a plate left in its place. The difference of the scans beyond their \
                        noise is the correlated error in every level of detection. With --artefact the plate has exactly the [target] of its \
                        file: gaps under templates on it are the scanner's own, and enter every template's uncertainty. Writes the \
                        file that [calibration] of the plant file names."
)]
pub(super) struct Command {
    /// Plant file
    plant: PathBuf,
    /// Scans of the same plate, nothing changed in between; at least two
    #[arg(required = true, num_args = 2..)]
    scans: Vec<PathBuf>,
    /// Plate file of the scanned plate
    #[arg(long, value_name = "PLATE.toml")]
    plate: PathBuf,
    /// The plate is an artefact that has exactly the shape of its [target]
    #[arg(long)]
    artefact: bool,
    /// File to write, instead of the one in the plant file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Estimated errors, with the scans behind them.
#[derive(Debug, Serialize)]
struct Summary {
    made: Timestamp,
    /// Scanner: maker, model, serial number.
    instrument: String,
    plate: String,
    /// Number of scans.
    scans: usize,
    /// Correlated error of a pair of scans, one sigma.
    sigma_correlated_mm: f64,
    /// Systematic error of a gap, one sigma; null without an artefact.
    sigma_true_mm: Option<f64>,
    pairs: Vec<PairRecord>,
    /// Gaps under templates on the artefact, one record for each chord.
    artefact: Vec<GapRecord>,
    file: PathBuf,
}

/// A null pair: two scans of the untouched plate, numbered from 1.
#[derive(Debug, Serialize)]
struct PairRecord {
    scans: [usize; 2],
    difference_mm: f64,
    stated_mm: f64,
}

/// Gaps under templates of one chord on the artefact.
#[derive(Debug, Serialize)]
struct GapRecord {
    chord_mm: f64,
    boards: usize,
    gap_rms_mm: f64,
    /// Systematic error with which the uncertainty covers 95 % of the gaps, one sigma.
    systematic_mm: f64,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let mut plant = PlantFile::load(&command.plant)?;
    let plate = PlateFile::load(&command.plate)?;
    let file = command.out.clone().or_else(|| plant.calibration.as_ref().map(|c| c.file.clone()));
    let file = file.ok_or_else(|| {
        let plant = command.plant.display();
        CliError::Usage(format!("{plant}: names no calibration; add [calibration] with file, or give --out"))
    })?;
    let shape = artefact_shape(command, &plate)?;
    plant.comparisons = vec![PluginUse::by_default("displacement")];
    let catalogue = common.catalogue();
    let mut rig = Pipeline::of(&plant, &catalogue)?;

    let mut surfaces: Vec<Surface> = Vec::new();
    let mut instrument = String::new();
    for scan in &command.scans {
        let last = surfaces.last().map(|surface| PreviousPose { surface, fed_by: None });
        let (scanned, measured) =
            measure::measure_file(&catalogue, &mut rig, scan, &plate, last, Baseline::None)?;
        instrument = scanned.header.instrument;
        surfaces.push(measured.measurement.surface);
    }
    progress::phase("comparing");
    let (pairs, excess) = null_pairs(&rig, &plate, &surfaces)?;
    if excess > NULL_LIMIT {
        return Err(CliError::Failed(format!(
            "the scans differ by {:.1} mm beyond their noise: the plate was bent between them, or is not the same; scan one \
             plate without bending it",
            mm(excess)
        )));
    }
    let sigma_correlated = nominal_sigma(&rig, &plate, &surfaces)?;
    let artefact =
        shape.map(|shape| artefact(&surfaces, &shape, &chords(&plate), sigma_correlated)).transpose()?;
    progress::done();

    let (gaps, sigma_true) = artefact.map_or((Vec::new(), None), |(gaps, sigma)| (gaps, Some(sigma)));
    let calibration = Calibration {
        made: Timestamp::now(),
        instrument,
        plate: plate.plate.id.clone(),
        scans: surfaces.len(),
        sigma_correlated,
        sigma_true,
    };
    output_folder::replace(&file, calibration.to_toml().as_bytes())?;
    let summary = Summary {
        made: calibration.made,
        instrument: calibration.instrument,
        plate: calibration.plate,
        scans: calibration.scans,
        sigma_correlated_mm: mm(sigma_correlated),
        sigma_true_mm: sigma_true.map(mm),
        pairs,
        artefact: gaps,
        file,
    };
    if common.json {
        output::json(&summary)?
    } else {
        print(&summary)?
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the known shape of an artefact, `None` without `--artefact`.
fn artefact_shape(command: &Command, plate: &PlateFile) -> Result<Option<TargetSurface>, CliError> {
    if !command.artefact {
        return Ok(None);
    }
    let usage = |why: String| CliError::Usage(format!("{}: {why}", command.plate.display()));
    let missing = || usage("an artefact needs a [target], the shape that it has".into());
    let target = plate.target.ok_or_else(missing)?;
    TargetSurface::of_plate(&target, &plate.plate).map(Some).map_err(|e| usage(e.to_string()))
}

/// A null pair, its scans numbered from 1, with figures of its comparison.
struct NullPair<const N: usize> {
    scans: [usize; 2],
    figures: [f64; N],
}

/// Returns the figures `names` of every null pair, that is of every two of the scans.
fn null_figures<const N: usize>(
    rig: &Pipeline,
    plate: &PlateFile,
    surfaces: &[Surface],
    sigma_correlated: f64,
    names: [&str; N],
) -> Result<Vec<NullPair<N>>, CliError> {
    let task = plate.task(sigma_correlated, None, false);
    let mut pairs = Vec::new();
    for (i, now) in surfaces.iter().enumerate() {
        for (k, before) in surfaces[..i].iter().enumerate() {
            let surfaces = Surfaces { now, before: Some(before), baseline: None };
            let reports = rig.comparisons.iter().map(|comparison| comparison.compare(&task, surfaces));
            let reports = reports.collect::<Result<Vec<_>, PluginError>>()?;
            let mut figures = [0.0; N];
            for (figure, name) in figures.iter_mut().zip(names) {
                let found = reports.iter().flat_map(|r| &r.findings.figures).find(|f| f.name == name);
                *figure = found.map(|f| f.value).ok_or_else(|| {
                    CliError::Failed(format!(
                        "displacement gives no figure {name}; install the plugin of this version"
                    ))
                })?;
            }
            pairs.push(NullPair { scans: [k + 1, i + 1], figures });
        }
    }
    Ok(pairs)
}

/// Compares every two of the scans: difference along the normal after rigid alignment, the noise stated for it, and the
/// excess of all differences over their noise.
fn null_pairs(
    rig: &Pipeline,
    plate: &PlateFile,
    surfaces: &[Surface],
) -> Result<(Vec<PairRecord>, f64), CliError> {
    let found = null_figures(rig, plate, surfaces, 0.0, ["displacement.rms", "displacement.sigma"])?;
    let mut pooled = Pooled::default();
    let records = found.into_iter().map(|NullPair { scans, figures: [difference, stated] }| {
        pooled.add(difference, stated);
        PairRecord { scans, difference_mm: mm(difference), stated_mm: mm(stated) }
    });
    let records = records.collect();
    Ok((records, pooled.excess()))
}

/// Returns the correlated error, one sigma, with which the null pairs show change over [`NOMINAL`] of their area. It is
/// 0 where noise alone shows less, else it is found by bisection. The range error of a scanner is periodic and bounded:
/// 1.96 times its root mean square exceeds its amplitude. A level of detection from the excess of the scatter would
/// therefore hide changes (0 to 1 % of the area instead of 5 %).
fn nominal_sigma(rig: &Pipeline, plate: &PlateFile, surfaces: &[Surface]) -> Result<f64, CliError> {
    let is_quiet = |sigma: f64| -> Result<bool, CliError> {
        let shares = null_figures(rig, plate, surfaces, sigma, ["displacement.above_lod"])?;
        let sum: f64 = shares.iter().map(|pair| pair.figures[0]).sum();
        Ok(sum <= NOMINAL * shares.len() as f64)
    };
    if is_quiet(0.0)? {
        return Ok(0.0);
    }
    let [mut low, mut high] = [0.0, NULL_LIMIT];
    while high - low > 0.02 * high && high > 1e-6 {
        // Bisects the logarithm once both bounds are positive.
        let middle = if low > 0.0 { (low * high).sqrt() } else { 0.25 * high };
        *(if is_quiet(middle)? { &mut high } else { &mut low }) = middle;
    }
    Ok(high)
}

/// Returns the chords of the plate file's templates; half the shorter side where it has none.
fn chords(plate: &PlateFile) -> Vec<f64> {
    let mut chords: Vec<f64> = plate.templates.iter().map(|template| template.chord).collect();
    chords.sort_by(f64::total_cmp);
    chords.dedup();
    if chords.is_empty() { vec![0.5 * plate.plate.width.min(plate.plate.height)] } else { chords }
}

/// Returns the gaps on the artefact, and the systematic error of the worst chord, one sigma.
fn artefact(
    surfaces: &[Surface],
    shape: &TargetSurface,
    chords: &[f64],
    sigma_correlated: f64,
) -> Result<(Vec<GapRecord>, f64), CliError> {
    let mut gaps = Vec::new();
    let mut worst: f64 = 0.0;
    for &chord in chords {
        let found: Vec<ArtefactGap> =
            surfaces.iter().flat_map(|now| artefact_gaps(now, shape, chord, sigma_correlated)).collect();
        if found.is_empty() {
            return Err(CliError::Failed(format!(
                "no template of {:.0} mm fits the seen part of the artefact; scan all of it or shorten chord_mm",
                mm(chord)
            )));
        }
        let square: f64 = found.iter().map(|g| g.gap * g.gap).sum();
        let systematic = covering(&found);
        worst = worst.max(systematic);
        gaps.push(GapRecord {
            chord_mm: mm(chord),
            boards: found.len(),
            gap_rms_mm: mm((square / found.len() as f64).sqrt()),
            systematic_mm: mm(systematic),
        });
    }
    Ok((gaps, worst))
}

fn print(summary: &Summary) -> Result<(), CliError> {
    let row = |PairRecord { scans: [a, b], difference_mm, stated_mm }: &PairRecord| {
        vec![format!("{a} and {b}"), format!("{difference_mm:.3}"), format!("{stated_mm:.3}")]
    };
    output::titled("scans | differ by mm | stated mm", summary.pairs.iter().map(row))?;
    if summary.pairs.len() < FEW_PAIRS {
        let pairs = summary.pairs.len();
        output::line(&format!("only {pairs} pairs: four scans or more make the estimate steady"))?;
    }
    output::line(&format!("correlated error of a pair: {:.3} mm", summary.sigma_correlated_mm))?;
    for gap in &summary.artefact {
        output::line(&format!(
            "templates of {:.0} mm on the artefact: {} gaps of {:.3} mm rms, of which {:.3} mm (one sigma) are systematic",
            gap.chord_mm, gap.boards, gap.gap_rms_mm, gap.systematic_mm
        ))?;
    }
    match summary.sigma_true_mm {
        Some(sigma) => output::line(&format!("systematic error of a gap: {sigma:.3} mm"))?,
        None => output::line("systematic error of a gap: unknown; scan an artefact and give --artefact")?,
    }
    output::line(&format!("wrote {}", summary.file.display()))
}
