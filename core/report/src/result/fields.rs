//! Search for a field of the comparisons by name.

use platen_model::{Field, Report};

/// Returns the field of this name and number of components: that of the plugin `owner`, to which the name belongs, else
/// the first of any comparison.
pub(super) fn find_field<'a>(
    reports: &[&'a Report],
    owner: &str,
    name: &str,
    components: usize,
) -> Option<&'a Field> {
    let is_field = |field: &&Field| field.name == name && field.components == components;
    let of = |own: bool| {
        let reports = reports.iter().filter(move |report| (report.comparison == owner) == own);
        reports.flat_map(|report| &report.fields).find(is_field)
    };
    of(true).or_else(|| of(false))
}
