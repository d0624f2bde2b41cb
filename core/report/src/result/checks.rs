//! Dimension checks of the result document, in millimetres and degrees.

use serde::{Deserialize, Serialize};

use platen_model::units::mm;
use platen_shape::{Check, EXPANDED, EdgeCheck, ShapeChecks};

/// Dimension checks, as by tape, square and sight line.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ShapeChecksRecord {
    /// Edges v = 0, u = W, v = H, u = 0.
    pub edges: [EdgeRecord; 4],
    /// Diagonals from (0,0) to (W,H) and from (W,0) to (0,H), straight.
    pub diagonals_mm: [CheckRecord; 2],
    /// First diagonal minus the second.
    pub diagonal_difference_mm: CheckRecord,
    /// Inner angles in the plate's surface, corners (0,0), (W,0), (W,H), (0,H).
    pub angles_deg: [CheckRecord; 4],
    /// Twist along u and along v: rotation of the far edge relative to the near one, clockwise positive.
    pub twist_deg: [CheckRecord; 2],
}

/// Lengths of one edge.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct EdgeRecord {
    /// Arc length along the edge of the scanned face, as by tape.
    pub face_mm: CheckRecord,
    /// Arc length on the mid-surface, to be compared with the cut size.
    pub mid_mm: CheckRecord,
    /// Chord from corner to corner.
    pub chord_mm: CheckRecord,
}

/// Figure with its expanded uncertainty (95 %), in the unit of its name.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct CheckRecord {
    /// Value.
    pub value: f64,
    /// Expanded uncertainty (95 %).
    pub uncertainty: f64,
    /// False if it depends on a corner that was extrapolated.
    pub seen: bool,
}

/// Names of the corners and of the edges, in their order.
pub(super) const CORNERS: [&str; 4] = ["(0, 0)", "(W, 0)", "(W, H)", "(0, H)"];
pub(super) const EDGES: [&str; 4] = ["edge v = 0", "edge u = W", "edge v = H", "edge u = 0"];

impl ShapeChecksRecord {
    pub(super) fn new(checks: &ShapeChecks) -> Self {
        let edge = |edge: EdgeCheck| EdgeRecord {
            face_mm: length(edge.face),
            mid_mm: length(edge.mid),
            chord_mm: length(edge.chord),
        };
        Self {
            edges: checks.edges.map(edge),
            diagonals_mm: checks.diagonals.map(length),
            diagonal_difference_mm: length(checks.diagonal_difference),
            angles_deg: checks.angles.map(turn),
            twist_deg: checks.twist.map(turn),
        }
    }

    /// Returns name, figure and unit of every check, in a fixed order.
    pub fn rows(&self) -> Vec<(String, CheckRecord, &'static str)> {
        let mut rows = Vec::new();
        for (k, how) in ["along the mid-surface", "tape on the face", "straight"].into_iter().enumerate() {
            for (name, edge) in EDGES.iter().zip(&self.edges) {
                let length = [edge.mid_mm, edge.face_mm, edge.chord_mm][k];
                rows.push((format!("{name}, {how}"), length, "mm"));
            }
        }
        rows.push(("diagonal (0, 0) to (W, H)".into(), self.diagonals_mm[0], "mm"));
        rows.push(("diagonal (W, 0) to (0, H)".into(), self.diagonals_mm[1], "mm"));
        rows.push(("difference of the diagonals".into(), self.diagonal_difference_mm, "mm"));
        for (name, angle) in CORNERS.iter().zip(&self.angles_deg) {
            rows.push((format!("angle at {name}"), *angle, "deg"));
        }
        rows.push(("twist, sighted along u".into(), self.twist_deg[0], "deg"));
        rows.push(("twist, sighted along v".into(), self.twist_deg[1], "deg"));
        rows
    }
}

fn length(check: Check) -> CheckRecord {
    CheckRecord { value: mm(check.value), uncertainty: mm(EXPANDED * check.sigma), seen: check.seen }
}

fn turn(check: Check) -> CheckRecord {
    let [value, uncertainty] = [check.value, EXPANDED * check.sigma].map(f64::to_degrees);
    CheckRecord { value, uncertainty, seen: check.seen }
}
