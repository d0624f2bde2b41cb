//! Search for the allowed name nearest to a misspelt one, by Jaro-Winkler similarity.

/// Below this Jaro-Winkler similarity a name is not a likely misspelling. `raidus_mm` and `radius_mm` score 0.97,
/// `chord` and `chord_mm` 0.93, `width_mm` and `height_mm` 0.82, unrelated keys of the plate file below 0.75.
const LIKELY: f64 = 0.80;

/// Returns the allowed name most similar to `found`, if any is a likely match; the first of equals.
pub fn nearest<'a>(found: &str, allowed: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let mut best: Option<(f64, &str)> = None;
    for name in allowed {
        let likeness = strsim::jaro_winkler(&found.to_lowercase(), &name.to_lowercase());
        if likeness >= LIKELY && best.is_none_or(|(most, _)| likeness > most) {
            best = Some((likeness, name));
        }
    }
    best.map(|(_, name)| name)
}

/// Returns `; did you mean "sphere"?` or nothing.
pub(crate) fn suggestion<'a>(found: &str, allowed: impl IntoIterator<Item = &'a str>) -> String {
    nearest(found, allowed).map(|name| format!("; did you mean \"{name}\"?")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn likely_misspellings_are_found_and_strangers_are_not() {
        let keys = ["id", "width_mm", "height_mm", "thickness_mm", "supports", "face_inset_mm"];
        let check = |found, expected| assert_eq!(nearest(found, keys), expected, "{found}");
        check("widht_mm", Some("width_mm"));
        check("thickness", Some("thickness_mm"));
        check("Height_mm", Some("height_mm"));
        check("colour", None);
        check("", None);
    }
}
