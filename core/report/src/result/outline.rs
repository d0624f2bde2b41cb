//! Outline to which the coordinates (u, v) of the plate refer.

use serde::{Deserialize, Serialize};

use platen_model::units::{metres, mm, mm_pair};
use platen_shape::Blank;

/// Edges of the plate in (u, v), and their source.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OutlineRecord {
    /// Source of the outline.
    pub from: OutlineSource,
    /// Mean length of the edges along u, corner to corner.
    pub width_mm: f64,
    /// Mean length of the edges along v.
    pub height_mm: f64,
    /// Diagonal from (0,0) minus the one from (W,0).
    pub diagonal_difference_mm: f64,
    /// Bow of the edges v = 0, u = W, v = H, u = 0: distance of the middle from the chord, positive outwards.
    pub bows_mm: [f64; 4],
    /// Corners (0,0), (W,0), (W,H), (0,H) in (u, v).
    pub corners_mm: [[f64; 2]; 4],
    /// Standard deviation of each corner along the outgoing and along the incoming edge, counter-clockwise.
    pub corner_sigma_mm: [[f64; 2]; 4],
    /// Standard deviation across each edge.
    pub edge_sigma_mm: [f64; 4],
}

/// Source of an outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OutlineSource {
    /// Rectangle of the plate file.
    Nominal,
    /// Scan of the blank.
    Baseline,
}

impl OutlineRecord {
    /// Records the outline of a blank, or without one the rectangle as ordered, metres.
    pub fn new(blank: Option<&Blank>, [width, height]: [f64; 2]) -> Self {
        let ordered = Blank::rectangle(width, height);
        let from = if blank.is_some() { OutlineSource::Baseline } else { OutlineSource::Nominal };
        let blank = blank.unwrap_or(&ordered);
        let [width, height] = blank.size();
        Self {
            from,
            width_mm: mm(width),
            height_mm: mm(height),
            diagonal_difference_mm: mm(blank.diagonal_difference()),
            bows_mm: blank.bows.map(mm),
            corners_mm: blank.corners.map(mm_pair),
            corner_sigma_mm: blank.corner_sigma.map(mm_pair),
            edge_sigma_mm: blank.edge_sigma.map(mm),
        }
    }

    /// Returns the blank, if its outline is from a scan; it equals the recorded one to the last bit.
    pub fn blank(&self) -> Option<Blank> {
        let blank = Blank {
            corners: self.corners_mm.map(|corner| corner.map(metres)),
            bows: self.bows_mm.map(metres),
            corner_sigma: self.corner_sigma_mm.map(|sigma| sigma.map(metres)),
            edge_sigma: self.edge_sigma_mm.map(metres),
        };
        (self.from == OutlineSource::Baseline).then(|| blank.rounded())
    }

    /// Describes the outline in one line.
    pub fn words(&self) -> String {
        match self.from {
            OutlineSource::Nominal => {
                format!("nominal, {:.1} x {:.1} mm as ordered", self.width_mm, self.height_mm)
            }
            OutlineSource::Baseline => format!(
                "baseline, the blank is {:.1} x {:.1} mm, its diagonals differ by {:.1} mm, its edges bow by {:.1} mm at most",
                self.width_mm,
                self.height_mm,
                self.diagonal_difference_mm,
                self.bows_mm.iter().fold(0.0_f64, |a, b| a.max(b.abs()))
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blank_comes_back_from_its_record_and_a_rectangle_is_none() {
        let nominal = OutlineRecord::new(None, [4.0, 3.0]);
        assert_eq!(nominal.words(), "nominal, 4000.0 x 3000.0 mm as ordered");
        assert_eq!(nominal.blank(), None);
        let mut blank = Blank::rectangle(4.0, 3.0);
        (blank.corners[2], blank.bows[1]) = ([4.0, 2.996], -0.002);
        assert_eq!(
            OutlineRecord::new(Some(&blank), [4.0, 3.0]).words(),
            "baseline, the blank is 4000.0 x 2998.0 mm, its diagonals differ by -2.4 mm, its edges bow by 2.0 mm at most"
        );
        for k in 0..1000 {
            let x = 1e-3 * (f64::from(k) * 0.618_033_988_749_895).fract();
            let [[corner, ..], ..] = &mut blank.corners;
            (*corner, blank.bows[1], blank.corner_sigma[1], blank.edge_sigma[2]) =
                (x, -x, [x, 3.0 * x], 7.0 * x);
            let written = blank.rounded();
            let text = serde_json::to_string(&OutlineRecord::new(Some(&written), [4.0, 3.0])).unwrap();
            let read = serde_json::from_str::<OutlineRecord>(&text).unwrap().blank();
            assert_eq!(read, Some(written));
        }
    }
}
