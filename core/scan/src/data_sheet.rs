//! Range errors of instrument families from their makers' data sheets, metres.

/// Families, by words of the instrument's name in lower case, with the range error in metres.
///
/// FARO Focus3D (S20, S120, X130, X330): "Ranging error +-2 mm at 10 m and 25 m", FARO Laser Scanner Focus3D, tech
/// sheet. The figure is taken as one standard deviation. Other models of the maker have other data sheets, and no
/// figure is assumed for them.
const FAMILIES: [([&str; 2], f64); 5] = [
    (["focus", "3d"], 2e-3),
    (["focus", "s20"], 2e-3),
    (["focus", "s120"], 2e-3),
    (["focus", "x130"], 2e-3),
    (["focus", "x330"], 2e-3),
];

/// Returns the range error of an instrument's family, one standard deviation, metres; `None` for a family without a
/// data sheet here. `instrument` is maker, model and serial number as in the header of a scan.
#[must_use]
pub fn data_sheet_range_error_m(instrument: &str) -> Option<f64> {
    let name = instrument.to_lowercase();
    let family = FAMILIES.iter().find(|(words, _)| words.iter().all(|word| name.contains(word)));
    family.map(|(_, error)| *error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_families_with_a_data_sheet_have_a_range_error() {
        for name in
            ["FARO LASER SCANNER FOCUS 3D LLS081200017", "Focus S120 LLS081200017", "FARO Focus3D X330"]
        {
            assert_eq!(data_sheet_range_error_m(name), Some(2e-3), "{name}");
        }
        for name in ["", "FARO Focus M70", "RIEGL VZ-400", "platen simulated scanner"] {
            assert_eq!(data_sheet_range_error_m(name), None, "{name}");
        }
    }
}
