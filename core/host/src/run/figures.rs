//! Mapping of the comparisons' findings to the figures in the press's registers.

use platen_model::{Figures, Measure, Measurement, Report, Timestamp, Verdict};
use platen_plant::PlateFile;
use platen_shape::Measured;

/// Returns the result for the press. `source` is the report of the one comparison whose figures fill the registers. A
/// figure that the report does not contain is absent, and its register holds the invalid value.
pub(super) fn measurement(
    measured: &Measured,
    source: Option<&Report>,
    verdict: Verdict,
    plate: &PlateFile,
    times: [(Measure, std::time::Duration); 3],
    scanned_at: jiff::Timestamp,
) -> Measurement {
    let mut figures = of_plate(measured, source, plate);
    figures.values.extend(times.map(|(measure, time)| (measure, time.as_secs_f64())));
    Measurement { judgement: verdict.into(), figures, scanned_at: timestamp(scanned_at), warning: None }
}

/// Returns the figures of a plate from the comparison that fills the registers, without the times of its stroke.
pub(crate) fn of_plate(measured: &Measured, source: Option<&Report>, plate: &PlateFile) -> Figures {
    let mut figures = Figures::default();
    let mut put = |measure: Measure, value: f64| {
        if value.is_finite() {
            figures.values.insert(measure, value);
        }
    };
    let found = || source.into_iter().flat_map(|report| &report.findings.figures);
    for figure in found() {
        if let Some(measure) = Measure::from_name(&figure.name) {
            put(measure, figure.value);
        }
    }
    put(Measure::Coverage, measured.measurement.quality.coverage);
    let station = |station: &platen_model::Station| {
        let name = format!("station.{}", station.name);
        let value = found().find(|figure| figure.name == name)?.value;
        value.is_finite().then_some(value)
    };
    figures.stations = plate.stations.iter().map(station).collect();
    figures
}

fn timestamp(at: jiff::Timestamp) -> Option<Timestamp> {
    let unix_s = u32::try_from(at.as_second()).ok()?;
    let ms = u16::try_from(at.subsec_millisecond()).ok()?;
    Some(Timestamp { unix_s, ms })
}
