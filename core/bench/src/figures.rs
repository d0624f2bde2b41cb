//! Figures of accuracy as table rows and as JSON.

use platen_model::units::mm;

use crate::accuracy::Accuracy;

use serde_json::{Map, Value as Json, json};

/// Figure of errors of type `E`: name in documents, head in tables, value in the unit of the name, digits after the
/// point.
pub(super) type Figure<E> = (&'static str, &'static str, fn(&E) -> f64, usize);

pub(super) const OF_MEASUREMENT: [Figure<Accuracy>; 9] = [
    ("corners_rms_mm", "corners", |a| mm(a.corners), 2),
    ("markers_mean_mm", "markers", |a| mm(a.markers_mean), 2),
    ("markers_worst_mm", "worst", |a| mm(a.markers_worst), 2),
    ("surface_inside_rms_mm", "surface", |a| mm(a.surface_inside), 3),
    ("surface_edge_rms_mm", "at edges", |a| mm(a.surface_edge), 3),
    ("d_u_std_mm", "d_u", |a| mm(a.side_u), 3),
    ("d_v_std_mm", "d_v", |a| mm(a.side_v), 3),
    ("theta_std_deg", "angle deg", |a| a.angle.to_degrees(), 4),
    ("curvature_rms_per_m", "curvature 1/m", |a| a.curvature, 5),
];

/// Returns the heads of the columns, after those of the row's name.
pub(super) fn head<E>(figures: &[Figure<E>], of: &[&str]) -> Vec<String> {
    of.iter().copied().chain(figures.iter().map(|(_, head, ..)| *head)).map(str::to_owned).collect()
}

/// Returns one measurement as a row.
pub(super) fn row(of: &str, accuracy: &Accuracy) -> Vec<String> {
    let cells = OF_MEASUREMENT.map(|(_, _, value, digits)| format!("{:.digits$}", value(accuracy)));
    std::iter::once(of.to_owned()).chain(cells).collect()
}

/// Returns many errors as a row of mean / worst.
pub(super) fn row_of_many<E>(figures: &[Figure<E>], of: &[&str], all: &[E]) -> Vec<String> {
    let cells = figures.iter().map(|(_, _, value, digits)| {
        let [mean, worst] = mean_and_worst(all.iter().map(value));
        format!("{mean:.digits$} / {worst:.digits$}")
    });
    of.iter().map(|cell| (*cell).to_owned()).chain(cells).collect()
}

/// Returns one measurement as a document.
pub(super) fn document(accuracy: &Accuracy) -> Map<String, Json> {
    OF_MEASUREMENT.iter().map(|(name, _, value, _)| ((*name).to_owned(), json!(value(accuracy)))).collect()
}

/// Returns many errors as a document: `{"mean": .., "worst": ..}` for each figure, after the entries `of`.
pub(super) fn document_of_many<E>(figures: &[Figure<E>], of: Json, all: &[E]) -> Json {
    let mut document = of;
    for (name, _, value, _) in figures {
        let [mean, worst] = mean_and_worst(all.iter().map(value));
        document[*name] = json!({ "mean": mean, "worst": worst });
    }
    document
}

/// Returns mean and largest absolute value.
fn mean_and_worst(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let n = values.clone().count().max(1) as f64;
    [values.clone().map(f64::abs).sum::<f64>() / n, values.map(f64::abs).fold(0.0, f64::max)]
}
