//! Reference inputs in closed form: meshes with known charts, surfaces, the task of a plate.

use platen_model::{
    Bend, Centre, Die, Facing, PlateHistory, PressedStroke, RadiusOf, ReferenceLine, Seat, Steel, Target,
    TargetShape, Task, Template,
};
use platen_shape::flatten::closed_form::{ClosedForm, cylinder};
use platen_shape::surface::{Mask, SplineFit, UniformKnots};
use platen_shape::{Surface, Vec3};

/// Extent of the plates along u and v, metres.
pub(crate) const SIZE: [f64; 2] = [3.0, 2.0];
const THICKNESS: f64 = 0.036;

/// Returns meshes of plates that were bent without stretching, with their names.
pub(crate) fn meshes() -> [(&'static str, ClosedForm); 3] {
    let flat = |[u, v]: [f64; 2]| [u, v, 0.0];
    let half = |[u, v]: [f64; 2]| {
        let bent = (u - 0.5 * SIZE[0]).max(0.0) / 6.0;
        [u.min(0.5 * SIZE[0]) + 6.0 * bent.sin(), v, 6.0 * (1.0 - bent.cos())]
    };
    [
        ("a flat plate", ClosedForm::new(flat, SIZE, [60, 40], 0.3, 1)),
        ("a cylinder of 6 m", ClosedForm::new(cylinder(6.0, 0.4), SIZE, [60, 40], 0.3, 2)),
        ("a half-bent plate", ClosedForm::new(half, SIZE, [60, 40], 0.3, 3)),
    ]
}

/// Returns meshes at the limits of a scan, with their names.
pub(crate) fn hard_meshes() -> [(&'static str, ClosedForm); 3] {
    let flat = |[u, v]: [f64; 2]| [u, v, 0.0];
    let dome = |[u, v]: [f64; 2]| [u, v, -0.1 * ((u - 1.5).powi(2) + (v - 1.0).powi(2))];
    [
        ("one cell", ClosedForm::new(flat, SIZE, [1, 1], 0.0, 1)),
        ("slivers", ClosedForm::new(flat, SIZE, [200, 2], 0.0, 1)),
        ("noise of 20 mm on a dome", ClosedForm::new(dome, SIZE, [60, 40], 0.45, 2).with_noise(0.02, 3)),
    ]
}

/// Returns a plate's mid-surface rolled to a radius in metres and seen up to a share of u. It is never `None`: there
/// are enough points to determine it.
pub(crate) fn surface(radius: f64, seen: f64) -> Option<Surface> {
    let mut fit = SplineFit::new(UniformKnots::new(0.0, SIZE[0], 30), UniformKnots::new(0.0, SIZE[1], 20));
    for k in 0..150 * 100 {
        let at = |k: i32, n: i32, length: f64| length * (f64::from(k) + 0.5) / f64::from(n);
        let (u, v) = (at(k % 150, 150, SIZE[0]), at(k / 150, 100, SIZE[1]));
        let turn = (u - 0.5 * SIZE[0]) / radius;
        let point = Vec3::new(5.0 + radius * turn.sin(), v - 1.0, -3.0 + radius * (1.0 - turn.cos()));
        fit.add(u, v, point.into(), 1e10);
    }
    let mut mask = Mask::unseen(SIZE[0], SIZE[1], 0.05);
    for k in 0..60 * 40 {
        let (u, v) = (0.05 * (f64::from(k % 60) + 0.5), 0.05 * (f64::from(k / 60) + 0.5));
        if u <= seen * SIZE[0] {
            mask.mark(u, v);
        }
    }
    Some(Surface::new(fit.solve([0.0, 0.0, 1.0]).ok()?, THICKNESS, mask))
}

/// Returns the task of that plate, with or without a target.
pub(crate) fn task(target: bool) -> Task {
    let shape = TargetShape::Cylinder { radius: 6.0, axis: std::f64::consts::FRAC_PI_2 };
    let target = target.then_some(Target { shape, radius_of: RadiusOf::Mid, scanned_face: Facing::Inside });
    Task {
        plate: "P".into(),
        width: SIZE[0],
        height: SIZE[1],
        thickness: THICKNESS,
        target,
        reference_lines: Vec::new(),
        templates: Vec::new(),
        stations: Vec::new(),
        sigma_correlated: 1e-4,
        sigma_true: None,
        supports: Vec::new(),
        supports_changed: false,
    }
}

/// Returns the history of that plate after this number of strokes from its left edge, with one template along u.
pub(crate) fn history(strokes: usize) -> PlateHistory {
    let line = ReferenceLine { name: "L".into(), from: [0.0, 1.0], to: [SIZE[0], 1.0] };
    let template = Template {
        name: "T".into(),
        line: "L".into(),
        chord: 2.0,
        centre: Centre::Worst,
        limit: 3e-3,
        seat: Seat::Gravity,
        source: None,
    };
    let stroke = |k: usize| PressedStroke {
        stroke: k as u16 + 1,
        depth: Some(4.5e-3),
        bends: vec![Bend {
            at: [0.3 + 0.3 * k as f64, 1.0],
            direction: std::f64::consts::FRAC_PI_2,
            angle: 0.03,
            sigma: 3e-4,
        }],
        ..PressedStroke::default()
    };
    PlateHistory {
        task: Task { reference_lines: vec![line], templates: vec![template], ..task(true) },
        templates: Vec::new(),
        die: Some(Die { id: 1, opening: 0.36, edge: 0.2, punch_radius: None }),
        steel: Some(Steel { grade: None, yield_strength: 440e6, heat: None }),
        strokes: (0..strokes).map(stroke).collect(),
        like: None,
        may_turn_over: true,
        tells_depth: true,
    }
}
