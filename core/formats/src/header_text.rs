//! Header of a scan as text, for the description of a written E57 point cloud, which has no fields for nominal angles.
//!
//! One line per field, `name value`, after a title line with the version. Floats are written in the shortest form that
//! parses to the same bits. A reader skips lines with an unknown name.

use std::fmt::Write as _;

use platen_scan::ScanHeader;

const TITLE: &str = "platen.scan/1";

/// Returns the header and the number of warm-up columns as lines of text.
pub(crate) fn to_text(header: &ScanHeader, warm_up_columns: u32) -> String {
    let mut text = format!("{TITLE}\n");
    let mut put = |name: &str, value: &dyn std::fmt::Display| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name} {value}");
    };
    put("rows", &header.n_rows);
    put("columns", &header.n_columns);
    put("azimuth_start", &header.azimuth_start);
    put("azimuth_step", &header.azimuth_step);
    put("elevation_start", &header.elevation_start);
    put("elevation_step", &header.elevation_step);
    put("intensity_min", &header.intensity_range.0);
    put("intensity_max", &header.intensity_range.1);
    put("warm_up_columns", &warm_up_columns);
    if let Some(seam) = header.seam_column {
        put("seam_column", &seam);
    }
    if let Some(time) = header.acquired_unix_s {
        put("acquired_unix_s", &time);
    }
    if let Some(error) = header.range_error_m {
        put("range_error_m", &error);
    }
    put("simulated", &header.simulated);
    put("instrument", &one_line(&header.instrument));
    header.notes.iter().for_each(|note| put("note", &one_line(note)));
    text
}

/// Parses the text of [`to_text`] into header and warm-up columns; `None` for any other text.
pub(crate) fn from_text(text: &str) -> Option<(ScanHeader, u32)> {
    let mut lines = text.trim().lines();
    lines.next().filter(|title| title.trim() == TITLE)?;
    let (mut header, mut warm_up_columns) = (ScanHeader::default(), 0);
    for line in lines {
        let (name, value) = line.split_once(' ').unwrap_or((line, ""));
        match name {
            "rows" => header.n_rows = value.parse().ok()?,
            "columns" => header.n_columns = value.parse().ok()?,
            "azimuth_start" => header.azimuth_start = value.parse().ok()?,
            "azimuth_step" => header.azimuth_step = value.parse().ok()?,
            "elevation_start" => header.elevation_start = value.parse().ok()?,
            "elevation_step" => header.elevation_step = value.parse().ok()?,
            "intensity_min" => header.intensity_range.0 = value.parse().ok()?,
            "intensity_max" => header.intensity_range.1 = value.parse().ok()?,
            "warm_up_columns" => warm_up_columns = value.parse().ok()?,
            "seam_column" => header.seam_column = Some(value.parse().ok()?),
            "acquired_unix_s" => header.acquired_unix_s = Some(value.parse().ok()?),
            "range_error_m" => header.range_error_m = Some(value.parse().ok()?),
            "simulated" => header.simulated = value.parse().ok()?,
            "instrument" => header.instrument = value.to_owned(),
            "note" => header.notes.push(value.to_owned()),
            _ => {}
        }
    }
    Some((header, warm_up_columns))
}

fn one_line(text: &str) -> String {
    text.replace(['\n', '\r'], " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_comes_back_to_the_last_bit() {
        let header = ScanHeader {
            n_rows: 1081,
            n_columns: 1092,
            azimuth_start: 0.1 + 0.2,
            azimuth_step: 1.0 / 3e3,
            elevation_start: -std::f64::consts::E / 7.0,
            elevation_step: 5e-324,
            seam_column: Some(546),
            intensity_range: (3, 2047),
            simulated: true,
            instrument: "maker model 17".to_owned(),
            acquired_unix_s: Some(1.7e9 + 0.123),
            range_error_m: Some(0.002),
            notes: vec!["row 0 is at the top".to_owned(), "a note  with blanks".to_owned()],
        };
        assert_eq!(from_text(&to_text(&header, 10)), Some((header, 10)));
        let empty = ScanHeader::default();
        assert_eq!(from_text(&to_text(&empty, 0)), Some((empty, 0)));
    }

    #[test]
    fn other_text_is_no_header() {
        for text in ["", "a remark", "platen.scan/2\nrows 3", "platen.scan/1\nrows three"] {
            assert_eq!(from_text(text), None, "{text}");
        }
    }
}
