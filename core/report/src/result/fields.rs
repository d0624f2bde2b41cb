//! Fields of comparisons, found by name.

use platen_model::{Field, Report};

/// Returns a field of so many components: that of the plugin `owner`, whose name it is, else the first of any comparison.
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
