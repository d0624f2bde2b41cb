//! Command `platen history compare`: two strokes compared in the plate's coordinates (u, v).

use std::path::PathBuf;

use clap::Args;
use platen_engine::calibration::Calibration;
use platen_engine::pipeline;
use platen_engine::plugin::Surfaces;
use platen_engine::scanner_error::ScannerError;
use platen_history::Stroke;
use platen_model::units::mm;
use platen_model::{Report, Verdict};
use platen_plant::{PlateFile, PluginUse};
use platen_report::picture::Caption;
use platen_report::result::{PlateRecord, figure};
use platen_report::{history_view, output_folder};
use platen_shape::Surface;

use super::{RunRef, open};
use crate::cli::{CliError, Common, output};
use crate::progress;

use serde_json::json;

/// Comparisons that need two surfaces.
const COMPARISONS: [&str; 2] = ["displacement", "curvature"];

#[derive(Debug, Args)]
pub(super) struct Command {
    /// Plant file
    plant: PathBuf,
    /// The first stroke: run id or plate:stroke
    first: RunRef,
    /// The second stroke: run id or plate:stroke
    second: RunRef,
    /// New folder for maps (SVG), the table (CSV) and the mesh (PLY, VTK) of the difference
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<(), CliError> {
    if let Some(out) = command.out.as_ref().filter(|out| out.exists()) {
        return Err(CliError::Usage(output_folder::FilesError::Exists(out.clone()).to_string()));
    }
    let (plant, archive) = open(&command.plant)?;
    let (first, second) = (command.first.find(&archive)?, command.second.find(&archive)?);
    let (before, now) = (surface(&first)?, surface(&second)?);
    same_size(&first, &before, &second, &now)?;
    let unknown = || CliError::Failed(format!("{}: no recipe on record", name(&second)));
    let plate = PlateFile::load(&plant.plate_path(second.recipe.ok_or_else(unknown)?))?;
    let surfaces = Surfaces { now: &now, before: Some(&before), baseline: None };
    let document =
        |stroke: &Stroke| stroke.document.as_deref().map(history_view::read_document).unwrap_or_default();
    let (earlier, document) = (document(&first), document(&second));
    // The present calibration, whatever the age of the record.
    let calibration = plant.calibration.as_ref().and_then(|wanted| Calibration::load(&wanted.file).ok());
    let assumed = || ScannerError::assumed(plant.range_error, document.range_error(), &now);
    let scanner =
        calibration.as_ref().map_or_else(assumed, |calibration| ScannerError::calibrated(calibration, &now));
    scanner.log();
    let task = scanner.task(&plate, history_view::supports_changed(earlier.supports.as_deref(), &plate));
    let mut reports = Vec::new();
    for name in COMPARISONS {
        progress::phase(&format!("comparing: {name}"));
        let configured = plant.comparisons.iter().find(|wanted| wanted.plugin == name).cloned();
        let wanted = configured.unwrap_or_else(|| PluginUse::by_default(name));
        reports.push(pipeline::comparison(&common.catalogue(), &wanted)?.compare(&task, surfaces)?);
    }
    progress::done();
    let mut written = Vec::new();
    if let Some(out) = &command.out {
        std::fs::create_dir_all(out)?;
        let title = format!("Run {} against {}", second.run_id, first.run_id);
        // A comparison of two strokes has no verdict of its own; the second stroke's is shown.
        let verdict = second.verdict.unwrap_or(Verdict::NotMeasured);
        let caption = Caption { plate: &title, stroke: None, verdict };
        let all: Vec<&Report> = reports.iter().collect();
        let plate = PlateRecord::new(&plate, &now, None);
        written = output_folder::fields(out, &now, &all, &plate, &caption, None)?;
    }
    let figures = platen_history::compare(&first, &second);
    if common.json {
        let comparisons = reports.iter().map(|report| {
            let figures: Vec<_> = report.findings.figures.iter().map(figure).collect();
            json!({ "plugin": report.comparison, "says": report.findings.says, "figures": figures })
        });
        return output::json(&json!({
            "first": first.run_id, "second": second.run_id, "comparisons": comparisons.collect::<Vec<_>>(),
            "assumption": scanner.assumption,
            "figures": figures, "files": written,
        }));
    }
    output::line(&format!("from {} to {}", name(&first), name(&second)))?;
    for sentence in reports.iter().flat_map(|report| &report.findings.says).chain(&scanner.assumption) {
        output::line(&format!("  {sentence}"))?;
    }
    let rows = figures.iter().map(|figure| {
        let change = figure.first.zip(figure.second).map(|(a, b)| b - a);
        let numbers = [figure.first, figure.second, change].map(|value| output::number(value, 5));
        std::iter::once(figure.name.clone()).chain(numbers).collect()
    });
    output::titled("figure in m, rad, s, 1/m | first | second | change", rows)?;
    for file in &written {
        output::line(&format!("wrote {}", file.display()))?;
    }
    Ok(())
}

fn name(stroke: &Stroke) -> String {
    format!("run {} (plate {}, stroke {})", stroke.run_id, stroke.plate, history_view::label(stroke))
}

fn surface(stroke: &Stroke) -> Result<Surface, CliError> {
    let refused = |why: String| CliError::Failed(format!("{}: {why}; choose another stroke", name(stroke)));
    let document = stroke.document.as_deref().ok_or_else(|| refused("was not measured".into()))?;
    output_folder::surface_beside(document).map_err(refused)
}

/// Refuses plates of different size: their coordinates (u, v) do not denote the same points.
fn same_size(first: &Stroke, before: &Surface, second: &Stroke, now: &Surface) -> Result<(), CliError> {
    let size = |s: &Surface| format!("{:.1} x {:.1} mm", mm(s.width()), mm(s.height()));
    let [before, now] = [size(before), size(now)];
    if before == now {
        return Ok(());
    }
    let (first, second) = (name(first), name(second));
    Err(CliError::Failed(format!(
        "{first} measures {before}, {second} {now}: strokes are compared in (u, v); choose plates of one size"
    )))
}
