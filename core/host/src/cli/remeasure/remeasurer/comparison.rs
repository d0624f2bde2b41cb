//! Difference between a repeated result and the first result of its stroke.
//!
//! The uncertainty of a difference is the root sum of squares of both uncertainties (95 %), as if they were
//! independent. Both results come from one scan and share its noise, so it is an upper bound.

use std::path::Path;

use platen_history::Stroke;
use platen_model::Measure;
use platen_model::units::metres;
use platen_report::result::ResultRecord;

use super::Remeasured;

/// Difference from the first result, metres.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub(crate) struct Difference {
    /// Program that measured first; none if its document no longer exists.
    pub(crate) software: Option<String>,
    /// Largest gap under a template, now minus first.
    pub(crate) gap: Option<WithUncertainty>,
    /// Distance of the corner that moved most.
    pub(crate) corners: Option<WithUncertainty>,
    /// Distance of the marker that moved most.
    pub(crate) markers: Option<WithUncertainty>,
}

/// Value with its expanded uncertainty (95 %), metres.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub(crate) struct WithUncertainty {
    pub(crate) value: f64,
    pub(crate) uncertainty: f64,
}

impl Difference {
    /// Compares a result with the first one; `document` is its `result.json`, which an unmeasured stroke does not have.
    pub(crate) fn of(stroke: &Stroke, now: &Remeasured, document: &Path) -> Self {
        let first = stroke.document.as_deref().and_then(read);
        let figure = |measure: Measure| {
            let name = measure.name();
            stroke.figures.get(name).copied().zip(now.figures.get(name).copied())
        };
        let gap = figure(Measure::GapMax).zip(figure(Measure::GapUncertainty));
        let gap = gap.map(|((then, now), (u_then, u_now))| WithUncertainty {
            value: now - then,
            uncertainty: u_then.hypot(u_now),
        });
        let software = first.as_ref().map(|first| first.software.clone());
        let pair = first.as_ref().zip(read(document));
        let corners = pair.as_ref().and_then(|(first, now)| corners(first, now));
        let markers = pair.as_ref().and_then(|(first, now)| markers(first, now));
        Self { software, gap, corners, markers }
    }
}

fn read(document: &Path) -> Option<ResultRecord> {
    serde_json::from_slice(&std::fs::read(document).ok()?).ok()
}

fn corners(first: &ResultRecord, now: &ResultRecord) -> Option<WithUncertainty> {
    let uncertainties = first.corners_uncertainty_mm.zip(now.corners_uncertainty_mm)?;
    let moved = (0..4).map(|k| WithUncertainty {
        value: distance(first.corners_m[k], now.corners_m[k]),
        uncertainty: metres(uncertainties.0[k].hypot(uncertainties.1[k])),
    });
    largest(moved)
}

fn markers(first: &ResultRecord, now: &ResultRecord) -> Option<WithUncertainty> {
    let pairs = first.markers.iter().filter_map(|then| {
        let now = now.markers.iter().find(|now| now.name == then.name)?;
        Some(WithUncertainty {
            value: distance(then.position_m, now.position_m),
            uncertainty: metres(then.uncertainty_mm.hypot(now.uncertainty_mm)),
        })
    });
    largest(pairs)
}

fn largest(moved: impl Iterator<Item = WithUncertainty>) -> Option<WithUncertainty> {
    moved.max_by(|a, b| a.value.total_cmp(&b.value))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}
