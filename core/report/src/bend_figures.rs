//! Bend figures in the output of a comparison: `bend.N.angle` with its place, `.direction`, `.length` and `.width`, as
//! from `curvature`.

use platen_model::Figure;

/// Figures of one bend, in metres and radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BendFigures {
    /// Centre of the band, (u, v).
    pub at: [f64; 2],
    /// Bend angle across the band, positive towards the scanner.
    pub angle: f64,
    /// Its expanded uncertainty (95 %).
    pub uncertainty: Option<f64>,
    /// Direction of its straight lines, from u towards v.
    pub direction: f64,
    /// Extent along the straight lines.
    pub length: Option<f64>,
    /// Extent across the straight lines.
    pub width: Option<f64>,
}

/// Returns the bends by their number, up to the first that lacks its angle, place or direction.
#[must_use]
pub fn bend_figures(figures: &[Figure]) -> Vec<BendFigures> {
    let figure = |name: String| figures.iter().find(|figure| figure.name == name);
    let bend = |number: usize| {
        let angle = figure(format!("bend.{number}.angle"))?;
        let value = |part: &str| figure(format!("bend.{number}.{part}")).map(|figure| figure.value);
        Some(BendFigures {
            at: angle.at?,
            angle: angle.value,
            uncertainty: angle.uncertainty,
            direction: value("direction")?,
            length: value("length"),
            width: value("width"),
        })
    };
    (1..).map_while(bend).collect()
}
