//! Command `platen measure`: measures the plate in one scan file, and compares it with earlier scans if they are given.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use jiff::Timestamp;
use platen_engine::calibration;
use platen_engine::pipeline::Pipeline;
use platen_engine::plugin::{Catalogue, JobSpec, Surfaces};
use platen_engine::stroke::{self, Baseline, NotMeasured, PreviousPose};
use platen_plant::PlateFile;
use platen_report::output_folder;
use platen_report::result::ResultRecord;
use platen_shape::Surface;
use platen_shape::{Measured, PlateSpec, Scanned};

use super::scan_source::{self, READ_LIMIT};
use super::setup::Setup;
use super::{CliError, Common, output};
use crate::judgement::{self, Circumstances, Judgement};
use crate::progress;

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen measure scan.e57 --plate config/plates/plate-017.toml\n  \
                        platen measure after.e57 --before before.e57 --plate plate.toml --plant plant.toml --out results/a17\n  \
                        platen measure bent.e57 --baseline flat.e57 --plate plate.toml\n  \
                        platen measure after.e57 --before before.e57 --turned 180 --plate plate.toml\n  \
                        platen measure scan.ptx --plate plate.toml --json | jq .markers\n\n\
                        The exit code is 0 when the plate was measured, whatever the verdict.")]
pub(super) struct Command {
    /// Scan file: structured E57, PTX, XYZ with row and column, XYB
    scan: PathBuf,
    #[command(flatten)]
    setup: Setup,
    /// Scan of the same plate after the previous stroke
    #[arg(long, value_name = "SCAN")]
    before: Option<PathBuf>,
    /// Scan of the same plate before the first stroke; (u, v) of all scans then refer to its outline
    #[arg(long, value_name = "SCAN")]
    baseline: Option<PathBuf>,
    /// Turn of the plate since the scan before it, degrees, counter-clockwise seen from above the press; as the press's
    /// register `plate_rot` reports it during `platen run`
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    turned: Option<f64>,
    /// New folder for result.json, tables (CSV), the plate as a mesh (PLY, VTK) and pictures (SVG)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    if let Some(out) = command.out.as_ref().filter(|out| out.exists()) {
        return Err(CliError::Usage(output_folder::FilesError::Exists(out.clone()).to_string()));
    }
    if command.turned.is_some() && command.before.is_none() && command.baseline.is_none() {
        return Err(CliError::Usage(
            "--turned needs the scan before the turn: --before or --baseline".into(),
        ));
    }
    let catalogue = common.catalogue();
    let (plant, plate) = command.setup.load()?;
    let calibration = plant.calibration.as_ref().and_then(|wanted| {
        // A file contains no record of the scanner's warm-up; the scanner counts as warm.
        let calibration = calibration::in_force(wanted, Timestamp::now(), wanted.warm_up);
        calibration.map_err(|why| tracing::warn!("{why}")).ok()
    });
    let mut rig = Pipeline::of(&plant, &catalogue)?;
    // In the order of acquisition: the corner (0, 0) is carried from one scan to the next.
    let mut measure = |scan: &Path, last: Option<PreviousPose<'_>>, baseline: Baseline<'_>| {
        measure_file(&catalogue, &mut rig, scan, &plate, last, baseline)
    };
    let mut earlier = |scan: &Option<PathBuf>, last: Option<&Surface>, baseline: Baseline<'_>| {
        let last = last.map(|surface| PreviousPose { surface, fed_by: None });
        let measured = scan.as_deref().map(|scan| measure(scan, last, baseline)).transpose()?;
        Ok::<_, CliError>(measured.map(|(_, measured)| (measured.measurement.surface, measured.blank)))
    };
    let (baseline, blank) = earlier(&command.baseline, None, Baseline::This)?.unzip();
    let blank = blank.flatten();
    let cut = blank.as_ref().map_or(Baseline::None, Baseline::Earlier);
    let before = earlier(&command.before, baseline.as_ref(), cut)?.map(|(surface, _)| surface);
    let fed_by = command.turned.map(f64::to_radians);
    let last = before.as_ref().or(baseline.as_ref()).map(|surface| PreviousPose { surface, fed_by });
    let (scanned, now) = measure(&command.scan, last, cut)?;

    progress::phase("comparing");
    let surfaces =
        Surfaces { now: &now.measurement.surface, before: before.as_ref(), baseline: baseline.as_ref() };
    let circumstances = Circumstances {
        plant: &plant,
        plate: &plate,
        calibration: calibration.as_ref(),
        scanner: None,
        stroke: None,
        supports_changed: false,
    };
    let Judgement { record, reports, .. } = judgement::judge(&rig, &scanned, &now, surfaces, circumstances);
    progress::done();

    let sound: Vec<_> = reports.iter().flatten().collect();
    let mut written = Vec::new();
    if let Some(out) = &command.out {
        let surface = &now.measurement.surface;
        written = output_folder::write(out, &record, surface)?;
        written.extend(output_folder::illustrate(out, &record, surface, &sound, &[])?);
    }
    if common.json {
        output::json(&record)?;
    } else {
        print(&record)?;
        for file in &written {
            output::line(&format!("wrote {}", file.display()))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Measures one scan file through the driver `faro-file`; `last` is the plate's pose in the previous scan.
pub(super) fn measure_file(
    catalogue: &Catalogue,
    rig: &mut Pipeline,
    scan: &Path,
    plate: &PlateFile,
    last: Option<PreviousPose<'_>>,
    baseline: Baseline<'_>,
) -> Result<(Scanned, Measured), CliError> {
    let failed = |e: NotMeasured| CliError::Failed(format!("{}: {e}", scan.display()));
    let spec = rig.spec(plate);
    let scanned = scan_file(catalogue, scan, &spec)?.map_err(failed)?;
    let measured = stroke::measure_scanned(rig, &scanned, &spec, last, baseline).map_err(failed)?;
    Ok((scanned, measured))
}

/// Reads one scan file with the driver `faro-file` and finds the plate in it; the inner error is about the plate.
pub(crate) fn scan_file(
    catalogue: &Catalogue,
    scan: &Path,
    spec: &PlateSpec,
) -> Result<Result<Scanned, NotMeasured>, CliError> {
    let scanner = scan_source::open(catalogue, scan, None)?;
    progress::phase(&format!("measuring {}", scan.display()));
    Ok(stroke::scan(&scanner, JobSpec::untriggered(READ_LIMIT), None, spec, None))
}

fn print(record: &ResultRecord) -> Result<(), CliError> {
    output::line(&format!("plate {}: {}", record.plate, record.verdict.words()))?;
    for sentence in &record.says {
        output::line(&format!("  {sentence}"))?;
    }
    let quality = &record.quality;
    output::line(&format!(
        "scan: {} x {} cells, {} on the plate, {:.0} % of it seen, step {:.1} mm, noise {:.2} mm, surface rms {:.2} mm",
        record.scan.rows,
        record.scan.columns,
        record.scan.plate_points,
        quality.coverage * 100.0,
        quality.lattice_step_mm,
        quality.noise_mm,
        record.surface.rms_mm,
    ))?;
    for note in &record.scan.notes {
        output::line(&format!("  {note}"))?;
    }
    if let Some(outline) = &record.outline {
        output::line(&format!("outline: {}", outline.words()))?;
    }
    let (w, h) = record.extent_mm();
    let ordered = [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]];
    let corners_mm = record.outline.as_ref().map_or(ordered, |outline| outline.corners_mm);
    let corners = record.corners_m.iter().zip(corners_mm).enumerate().map(|(k, (corner, [u, v]))| {
        row("corner", u, v, corner, record.corners_uncertainty_mm.map(|uncertainties| uncertainties[k]))
    });
    let markers =
        record.markers.iter().map(|m| row(&m.name, m.u_mm, m.v_mm, &m.position_m, Some(m.uncertainty_mm)));
    output::titled("place | u mm | v mm | x m | y m | z m | +- mm", corners.chain(markers))?;
    let checks = record.shape_checks.rows().into_iter().map(|(name, check, unit)| {
        let digits = if unit == "mm" { 1 } else { 3 };
        let number = |value: f64| format!("{value:.digits$}");
        let seen = if check.seen { "yes" } else { "corner not seen" };
        vec![name, number(check.value), number(check.uncertainty), unit.into(), seen.into()]
    });
    output::titled("check | value | +- (95 %) | unit | seen", checks)?;
    let t = &record.timings_ms;
    output::line(&format!(
        "ms: acquire {:.0}, extract {:.0}, outline {:.0}, mesh {:.0}, flatten {:.0}, surface {:.0}, compare {:.0}; \
         after the last column {:.0}",
        t.acquire, t.extract, t.outline, t.mesh, t.flatten, t.surface, t.compare, t.total
    ))
}

/// Formats whole millimetres, 0 without a sign.
fn millimetres(x: f64) -> String {
    format!("{:.0}", x.round() + 0.0)
}

fn row(name: &str, u: f64, v: f64, [x, y, z]: &[f64; 3], uncertainty: Option<f64>) -> Vec<String> {
    vec![
        name.to_owned(),
        millimetres(u),
        millimetres(v),
        format!("{x:.4}"),
        format!("{y:.4}"),
        format!("{z:.4}"),
        output::number(uncertainty, 2),
    ]
}
