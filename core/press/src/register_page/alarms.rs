//! Alarm table as CSV, for the alarm list of a press's HMI.

use platen_model::{Code, Language};

/// Returns the table of alarms as CSV for the HMI: code, severity, text and remedy.
pub fn alarms_csv(language: Language) -> String {
    let mut csv = String::from("code,severity,text,remedy\n");
    for code in Code::ALL {
        let alarm = code.alarm();
        let severity = alarm.severity.name();
        let (text, remedy) = (alarm.text(language), alarm.remedy(language));
        csv += &format!("{},{severity},\"{text}\",\"{remedy}\"\n", code.number());
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_has_a_row_of_four_columns_per_alarm_in_each_language() {
        for language in [Language::En, Language::Ja] {
            let csv = alarms_csv(language);
            assert_eq!(csv.lines().count(), Code::ALL.len() + 1);
            for line in csv.lines().skip(1) {
                assert_eq!(line.split("\",\"").count(), 2, "{line}");
                assert_eq!(line.matches('"').count(), 4, "{line}");
            }
        }
    }
}
