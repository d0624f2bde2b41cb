//! Selection of recorded strokes: arguments of `history list`, `history export` and `remeasure`.

use clap::Args;
use jiff::Timestamp;
use jiff::civil::Date;
use jiff::tz::TimeZone;
use platen_history::Filter;
use platen_model::Verdict;

/// Conditions, all of which a stroke must meet.
#[derive(Debug, Args)]
pub(super) struct Selection {
    /// Only strokes of this plate, by its number in the history
    #[arg(long)]
    plate: Option<u32>,
    /// Only strokes of this part, by the press's number
    #[arg(long, value_name = "ID")]
    part: Option<u32>,
    /// Only strokes accepted at this time or later: 2026-05-04 (UTC) or 2026-05-04T06:00:00Z
    #[arg(long, value_name = "TIME", value_parser = time)]
    since: Option<Timestamp>,
    /// Only strokes accepted before this time
    #[arg(long, value_name = "TIME", value_parser = time)]
    until: Option<Timestamp>,
    /// Only strokes with this verdict: pass, fail, cannot_tell, not_measured
    #[arg(long, value_parser = verdict)]
    verdict: Option<Verdict>,
    /// Number of strokes, the newest
    #[arg(long)]
    newest: Option<u32>,
}

impl Selection {
    /// Returns the conditions of the query; `newest` where the command line has none.
    pub(super) fn filter(&self, newest: Option<u32>) -> Filter {
        Filter {
            plate: self.plate,
            part_id: self.part,
            since: self.since,
            until: self.until,
            verdict: self.verdict,
            newest: self.newest.or(newest),
        }
    }
}

fn time(text: &str) -> Result<Timestamp, String> {
    let day = || text.parse::<Date>().ok()?.to_zoned(TimeZone::UTC).ok().map(|day| day.timestamp());
    text.parse()
        .ok()
        .or_else(day)
        .ok_or_else(|| "give a day like 2026-05-04 (UTC) or a time like 2026-05-04T06:00:00Z".to_owned())
}

fn verdict(text: &str) -> Result<Verdict, String> {
    Verdict::from_text(text).ok_or_else(|| "give pass, fail, cannot_tell or not_measured".to_owned())
}

#[cfg(test)]
mod tests {
    use super::time;

    #[test]
    fn a_time_is_a_day_or_a_moment() {
        assert_eq!(time("2026-05-04").unwrap().to_string(), "2026-05-04T00:00:00Z");
        assert_eq!(time("2026-05-04T06:00:00+02:00").unwrap().to_string(), "2026-05-04T04:00:00Z");
        assert!(time("May").unwrap_err().contains("2026-05-04"));
    }
}
