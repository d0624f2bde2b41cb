//! Comparison of two strokes: their figures side by side.

use std::collections::BTreeSet;

use crate::Stroke;

/// One figure of two strokes; `None` where a stroke lacks it.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Difference {
    /// Name of the figure.
    pub name: String,
    /// Its value in the first stroke.
    pub first: Option<f64>,
    /// Its value in the second.
    pub second: Option<f64>,
}

/// Returns every figure of either stroke, by name.
pub fn compare(first: &Stroke, second: &Stroke) -> Vec<Difference> {
    let names: BTreeSet<&String> = first.figures.keys().chain(second.figures.keys()).collect();
    let value = |stroke: &Stroke, name: &String| stroke.figures.get(name).copied();
    let row = |name: &String| Difference {
        name: name.clone(),
        first: value(first, name),
        second: value(second, name),
    };
    names.into_iter().map(row).collect()
}
