//! Press capability: gap under a board due to the repeatability of the ram, compared with the limit, to first order.
//!
//! A ram with a repeatability s changes the bend angle by s / (w / 4) in a die of opening w. Under a board of chord c
//! this is a gap of c s / w. The press may take at most a third of the limit; the rest is for the places of bends, the
//! plates and the scan.

use platen_model::units::mm;
use platen_model::{Sentence, texts};

/// Largest share of the limit that a press may take.
const SHARE: f64 = 1.0 / 3.0;
/// Least number of strokes from which a scatter is estimated.
pub const LEAST_STROKES: usize = 10;

/// Press capability: repeatability of the ram, and the gap under a board that it leaves.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PressCapability {
    /// Standard deviation of the reached depth about the wanted depth, metres.
    pub ram_sigma: f64,
    /// Gap under the board due to this scatter, one standard deviation, metres.
    pub gap_sigma: f64,
    /// Chord of the board, metres.
    pub chord: f64,
    /// Largest gap allowed under the board, metres.
    pub limit: f64,
}

impl PressCapability {
    /// Assesses a ram of this scatter over a die of this opening, under a board; metres.
    #[must_use]
    pub fn new(ram_sigma: f64, opening: f64, chord: f64, limit: f64) -> Self {
        Self { ram_sigma, gap_sigma: chord / opening * ram_sigma, chord, limit }
    }

    /// Returns whether the press cannot hold the limit.
    #[must_use]
    pub fn is_too_coarse(&self) -> bool {
        self.gap_sigma > SHARE * self.limit
    }

    /// Returns the capability in words.
    #[must_use]
    pub fn sentence(&self) -> Sentence {
        let texts = if self.is_too_coarse() { TOO_COARSE } else { FINE_ENOUGH };
        let values = [
            format!("{:.2}", mm(self.ram_sigma)),
            format!("{:.1}", mm(self.gap_sigma)),
            format!("{:.1}", self.chord),
            format!("{:.1}", mm(self.limit)),
        ];
        Sentence::new(texts, &values.each_ref().map(String::as_str))
    }
}

texts! { ,
    TOO_COARSE "this press is too coarse for the limit: its ram repeats to {} mm, that is {} mm under a board of {} m, limit {} mm" "このプレスは許容値に対して粗すぎます: ラムの繰返し {} mm はすき間 {} mm に当たります (型板 {} m、許容 {} mm)"
    FINE_ENOUGH "this press is fine enough for the limit: its ram repeats to {} mm, that is {} mm under a board of {} m, limit {} mm" "このプレスは許容値に対して十分です: ラムの繰返し {} mm はすき間 {} mm に当たります (型板 {} m、許容 {} mm)"
}

/// Returns the wanted less the reached depths of the strokes that did not stop short. A stroke stopped short where the
/// difference is three robust standard deviations or more.
#[must_use]
pub fn without_short(offs: &[f64]) -> Vec<f64> {
    let mut sizes: Vec<f64> = offs.iter().map(|off| off.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    // The median of |x| is 0.6745 standard deviations.
    let robust = sizes.get(sizes.len() / 2).map_or(0.0, |median| median / 0.6745);
    offs.iter().copied().filter(|off| *off >= -3.0 * robust).collect()
}

/// Returns the standard deviation of wanted less reached depths about 0, metres, with its 95 % interval; `None` with
/// fewer than [`LEAST_STROKES`].
#[must_use]
pub fn ram_scatter(offs: &[f64]) -> Option<[f64; 3]> {
    if offs.len() < LEAST_STROKES {
        return None;
    }
    let n = offs.len() as f64;
    let sigma = (offs.iter().map(|off| off * off).sum::<f64>() / n).sqrt();
    // Chi squared by Wilson and Hilferty.
    let chi = |z: f64| n * (1.0 - 2.0 / (9.0 * n) + z * (2.0 / (9.0 * n)).sqrt()).powi(3);
    Some([sigma * (n / chi(1.96)).sqrt(), sigma, sigma * (n / chi(-1.96)).sqrt()])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ram_of_a_study_is_too_coarse() {
        let fine = PressCapability::new(0.1e-3, 0.36, 2.0, 3e-3);
        let coarse = PressCapability::new(0.3e-3, 0.36, 2.0, 3e-3);
        assert!(!fine.is_too_coarse() && coarse.is_too_coarse());
        assert!((coarse.gap_sigma - 1.667e-3).abs() < 1e-6);
    }

    /// Tables of chi squared: 20 degrees, 9.591 and 34.17.
    #[test]
    fn scatter_has_its_interval_and_leaves_out_what_stopped_short() {
        let mut offs: Vec<f64> = (0..20).map(|k| if k % 2 == 0 { 1e-4 } else { -1e-4 }).collect();
        offs.push(-3e-3);
        let [low, sigma, high] = ram_scatter(&without_short(&offs)).unwrap_or_default();
        assert!((sigma - 1e-4).abs() < 1e-12);
        assert!((low / sigma - (20.0_f64 / 34.17).sqrt()).abs() < 2e-3, "{low}");
        assert!((high / sigma - (20.0_f64 / 9.591).sqrt()).abs() < 5e-3, "{high}");
        assert_eq!(ram_scatter(&offs[..9]), None);
    }
}
