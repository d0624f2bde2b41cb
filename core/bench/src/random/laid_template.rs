//! Errors of template gaps and stations: the comparison `template` on the measured plate against the same comparison on
//! the true plate.

use std::time::Duration;

use platen_engine::pipeline;
use platen_engine::plugin::{Catalogue, Comparison, Surfaces};
use platen_engine::scanner_error::ScannerError;
use platen_host::cli::CliError;
use platen_model::{
    Centre, Quantity, ReferenceLine, Report, Seat, Station, Target, Task, Template, TemplateFinding,
};
use platen_numerics::reml::Penalty;
use platen_plant::Value;
use platen_shape::surface::{Mask, SplineFit, UniformKnots};
use platen_shape::{EXPANDED, PlateSpec, Surface, Vec3};

use super::plate_scene::RandomScene;
use super::stated::{Kind, Stated};
use crate::accuracy::TrueFace;
use crate::scene::Shot;

/// Time limit of a comparison.
const LIMIT: Duration = Duration::from_secs(60);
/// Chord of a template as a share of its line.
const CHORD: f64 = 0.6;
/// Positions of the stations as shares of the sides.
const STATIONS: [[f64; 2]; 5] = [[0.5, 0.5], [0.2, 0.3], [0.8, 0.3], [0.8, 0.7], [0.2, 0.7]];
/// Standard deviation of a true point, metres, and its weight, 1/m^2.
const KNOWN_TO: f64 = 1e-6;
const WEIGHT: f64 = 1.0 / (KNOWN_TO * KNOWN_TO);
/// Penalty of the third derivatives of the true surface, m^3, relative to that weight: negligible, but it determines
/// the spline between the outermost points.
const PENALTY: f64 = 1e-9 * WEIGHT;

/// Loads the comparison, without its search over the whole plate.
pub(super) fn load(catalogue: &Catalogue) -> Result<Comparison, CliError> {
    let (library, values) = pipeline::load_with(catalogue, "template", [("search", Value::Bool(false))])?;
    Ok(Comparison::create(&library, &values, LIMIT)?)
}

/// Returns the errors of the gaps under two templates, along u and along v, and of the stations. A figure is counted if
/// both plates have it; a gap is counted if its contacts were seen.
///
/// # Errors
/// A plate without a seat for its target; a truth that does not determine a surface.
pub(super) fn errors(
    comparison: &Comparison,
    scene: &RandomScene,
    shot: &Shot,
    measured: &Surface,
    scanner: &ScannerError,
) -> Result<Vec<Stated>, String> {
    let task = task(&shot.spec, scene.target, scanner);
    let report = |now: &Surface| {
        let report = comparison.compare(&task, Surfaces { now, before: None, baseline: None });
        report.map_err(|e| e.to_string())
    };
    let (found, known) = (report(measured)?, report(&true_surface(&shot.truth.face, &shot.spec)?)?);
    let gaps = found.findings.templates.iter().zip(&known.findings.templates);
    let gaps = gaps.filter(|(found, _)| is_seen(found, measured)).map(|(found, known)| Stated {
        kind: Kind::Gap,
        error: found.max_gap - known.max_gap,
        sigma: (found.uncertainty / EXPANDED).hypot(KNOWN_TO),
    });
    let stations = task.stations.iter().filter_map(|station| of_station(station, &found, &known));
    Ok(gaps.chain(stations).collect())
}

fn is_seen(finding: &TemplateFinding, surface: &Surface) -> bool {
    let [u, v] = finding.max_gap_at;
    surface.mask().seen(u, v) && finding.contacts.iter().all(|contact| contact.seen)
}

fn of_station(station: &Station, found: &Report, known: &Report) -> Option<Stated> {
    let name = format!("station.{}", station.name);
    let figure = |report: &Report| report.findings.figures.iter().find(|f| f.name == name).cloned();
    let (found, known) = (figure(found)?, figure(known)?);
    let kind = match station.quantity {
        // Under a contact of both seats the gap is zero by definition: no figure is measured.
        Quantity::Gap if found.value == 0.0 && known.value == 0.0 => return None,
        Quantity::Gap => Kind::StationGap,
        Quantity::Deviation => Kind::StationDeviation,
        Quantity::CurvatureDeficit => Kind::StationDeficit,
    };
    let known_to = if kind == Kind::StationDeficit { 0.0 } else { KNOWN_TO };
    let sigma = (found.uncertainty? / EXPANDED).hypot(known_to);
    Some(Stated { kind, error: found.value - known.value, sigma })
}

fn task(spec: &PlateSpec, target: Target, scanner: &ScannerError) -> Task {
    let PlateSpec { width, height, thickness, .. } = *spec;
    let line = |name: &str, from, to| ReferenceLine { name: name.into(), from, to };
    let template = |line: &str, length: f64| Template {
        name: line.into(),
        line: line.into(),
        chord: CHORD * length,
        centre: Centre::At(0.5 * length),
        limit: 0.003,
        seat: Seat::Gravity,
        source: None,
    };
    let station = |quantity: Quantity, k: usize| {
        let [x, y] = STATIONS[k];
        Station { name: format!("{quantity:?}.{k}"), at: [x * width, y * height], quantity }
    };
    let quantities = [Quantity::Gap, Quantity::Deviation, Quantity::CurvatureDeficit];
    let stations =
        quantities.into_iter().flat_map(|quantity| (0..STATIONS.len()).map(move |k| (quantity, k)));
    Task {
        plate: "bench".into(),
        width,
        height,
        thickness,
        target: Some(target),
        reference_lines: vec![
            line("u", [0.0, 0.5 * height], [width, 0.5 * height]),
            line("v", [0.5 * width, 0.0], [0.5 * width, height]),
        ],
        templates: vec![template("u", width), template("v", height)],
        stations: stations.map(|(quantity, k)| station(quantity, k)).collect(),
        sigma_correlated: scanner.correlated(),
        sigma_true: None,
        supports: Vec::new(),
        supports_changed: false,
    }
}

/// Interpolates the true points of the face, at most 50 mm apart, and returns the mid-surface below it.
fn true_surface(face: &TrueFace, spec: &PlateSpec) -> Result<Surface, String> {
    let PlateSpec { width, height, thickness, .. } = *spec;
    let at = |k: usize| {
        let share = |i: usize, n: usize| i as f64 / (n - 1) as f64;
        [width * share(k % face.nu, face.nu), height * share(k / face.nu, face.nv)]
    };
    let through = |place: &dyn Fn(usize) -> Vec3, thickness: f64| -> Result<Surface, String> {
        let axis = |length: f64, n: usize| UniformKnots::new(0.0, length, n - 1);
        let mut fit = SplineFit::<3>::new(axis(width, face.nu), axis(height, face.nv));
        for k in 0..face.nu * face.nv {
            let [u, v] = at(k);
            fit.add(u, v, place(k).into(), WEIGHT);
        }
        let fitted = fit.solve_with(Penalty { u: PENALTY, v: PENALTY }).map_err(|e| e.to_string())?;
        let mask = Mask::from_cells(width, height, [1, 1], vec![true]).ok_or("no mask")?;
        Ok(Surface::new(fitted, thickness, mask))
    };
    let of_face = |k: usize| Vec3::from(face.position_m[k]);
    let top = through(&of_face, 0.0)?;
    let below = |k: usize| {
        let [u, v] = at(k);
        of_face(k) - top.normal(u, v) * (0.5 * thickness)
    };
    through(&below, thickness)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cylinder of radius R: positions, normals and curvature of the mid-surface are recovered from its face.
    #[test]
    fn the_true_surface_is_that_of_the_face() {
        let (radius, thickness, [nu, nv]) = (5.0, 0.04, [61, 51]);
        let spec = PlateSpec {
            width: 3.0,
            height: 2.5,
            thickness,
            face_inset: 0.0,
            root_face: 0.0,
            u_axis: None,
            region: None,
        };
        let place = |u: f64, v: f64, radius: f64| {
            let (sin, cos) = ((u - 1.5) / 5.0).sin_cos();
            Vec3::new(radius * sin, v, -radius * cos)
        };
        let face = (0..nu * nv)
            .map(|k| place(0.05 * (k % nu) as f64, 0.05 * (k / nu) as f64, radius - 0.5 * thickness).into());
        let surface = true_surface(&TrueFace { nu, nv, position_m: face.collect() }, &spec).unwrap();
        for [u, v] in [[0.0, 0.0], [1.23, 0.77], [2.99, 2.5]] {
            assert!((surface.point(u, v) - place(u, v, radius)).norm() < 1e-6, "{u} {v}");
            assert!((surface.curvature(u, v).u - 1.0 / radius).abs() < 1e-4, "{u} {v}");
        }
    }
}
