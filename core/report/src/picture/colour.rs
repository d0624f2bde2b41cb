//! Colours of maps, drawings and verdicts.
//!
//! Diverging colour map in OKLab (B. Ottosson, 2020), a space in which equal distances are equal perceived differences.

use plotters::style::RGBColor;

use platen_model::Verdict;

/// Colour of text and frames.
pub(super) const INK: RGBColor = RGBColor(26, 28, 31);
/// Colour of ticks, hatching and notes.
pub(super) const PALE: RGBColor = RGBColor(110, 114, 120);
/// Fill of the plate in a section.
pub(super) const STEEL: RGBColor = RGBColor(150, 158, 168);
/// Fill of a template in a section.
pub(super) const WOOD: RGBColor = RGBColor(226, 196, 150);
/// Edge of a template.
pub(super) const WOOD_EDGE: RGBColor = RGBColor(138, 98, 46);
pub(super) const PAPER: RGBColor = RGBColor(255, 255, 255);

/// Lightness and chroma along a branch: gray, most vivid, darkest.
const PATH: [[f64; 2]; 3] = [[0.89, 0.0], [0.68, 0.115], [0.42, 0.125]];
/// Hues of the negative and the positive branch, degrees: blue and orange, distinct in every common form of colour
/// blindness.
const HUES: [f64; 2] = [255.0, 45.0];

/// Returns the colour of a position from -1 to 1: blue through neutral gray to orange.
///
/// Equal steps in position are equal distances in OKLab. Both branches have the same lightness and chroma, so that
/// neither looks stronger.
pub(super) fn diverging(position: f64) -> RGBColor {
    let length = |from: [f64; 2], to: [f64; 2]| (to[0] - from[0]).hypot(to[1] - from[1]);
    let (first, second) = (length(PATH[0], PATH[1]), length(PATH[1], PATH[2]));
    let way = position.abs().min(1.0) * (first + second);
    let (from, to, part) = match way < first {
        true => (PATH[0], PATH[1], way / first),
        false => (PATH[1], PATH[2], (way - first) / second),
    };
    let [lightness, chroma] = [0, 1].map(|k| from[k] + (to[k] - from[k]) * part);
    let hue = HUES[usize::from(position > 0.0)].to_radians();
    let (sin, cos) = hue.sin_cos();
    srgb([lightness, chroma * cos, chroma * sin])
}

/// Converts OKLab to sRGB, with the matrices of its definition.
fn srgb([lightness, a, b]: [f64; 3]) -> RGBColor {
    let l = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let m = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let s = (lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    let linear = [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ];
    // Transfer function of sRGB, IEC 61966-2-1.
    let [r, g, b] = linear.map(|c| c.clamp(0.0, 1.0)).map(|c| match c <= 0.003_130_8 {
        true => 12.92 * c,
        false => 1.055 * c.powf(1.0 / 2.4) - 0.055,
    });
    let byte = |c: f64| (c * 255.0).round() as u8;
    RGBColor(byte(r), byte(g), byte(b))
}

/// Returns the colour of text on a position of the map: dark or white.
pub(super) fn text_on(position: f64) -> RGBColor {
    if position.abs() > 0.45 { PAPER } else { INK }
}

/// Returns the background colour of a verdict; it is never shown without the words.
pub(super) fn verdict(verdict: Verdict) -> RGBColor {
    match verdict {
        Verdict::Pass => RGBColor(22, 110, 90),
        Verdict::Fail => RGBColor(165, 60, 10),
        Verdict::CannotTell => RGBColor(122, 98, 10),
        Verdict::NotMeasured => RGBColor(90, 94, 100),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Converts back to OKLab, written independently.
    fn oklab(RGBColor(r, g, b): RGBColor) -> [f64; 3] {
        let [r, g, b] = [r, g, b]
            .map(|c| f64::from(c) / 255.0)
            .map(|c| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) });
        let l = (0.412_221_470_8 * r + 0.536_332_536_3 * g + 0.051_445_992_9 * b).cbrt();
        let m = (0.211_903_498_2 * r + 0.680_699_545_1 * g + 0.107_396_956_6 * b).cbrt();
        let s = (0.088_302_461_9 * r + 0.281_718_837_6 * g + 0.629_978_700_5 * b).cbrt();
        [
            0.210_454_255_3 * l + 0.793_617_785_0 * m - 0.004_072_046_8 * s,
            1.977_998_495_1 * l - 2.428_592_205_0 * m + 0.450_593_709_9 * s,
            0.025_904_037_1 * l + 0.782_771_766_2 * m - 0.808_675_766_0 * s,
        ]
    }

    #[test]
    fn equal_steps_look_alike_on_both_sides() {
        let steps: Vec<f64> = (-12..12)
            .map(|k| (f64::from(k) / 12.0, f64::from(k + 1) / 12.0))
            .map(|(a, b)| (oklab(diverging(a)), oklab(diverging(b))))
            .map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt())
            .collect();
        let mean = steps.iter().sum::<f64>() / steps.len() as f64;
        for step in &steps {
            assert!((step / mean - 1.0).abs() < 0.12, "{steps:?}");
        }
        for k in 0..=12 {
            let position = f64::from(k) / 12.0;
            let [low, high] = [-position, position].map(|p| oklab(diverging(p))[0]);
            assert!((low - high).abs() < 0.01, "{position}: {low} {high}");
        }
    }

    #[test]
    fn zero_is_neutral() {
        let RGBColor(r, g, b) = diverging(0.0);
        assert!(r == g && g == b, "{r} {g} {b}");
    }
}
