//! What goes wrong between scanner and host, by name.

use std::str::FromStr;

use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error as Unknown;

/// A fault of link, bridge or scanner. `number` is the column, the share (one in so many) or the milliseconds that the
/// kind says; 1 where it says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// What goes wrong.
    pub kind: FaultKind,
    /// Where, how often or how long.
    pub number: u32,
}

/// Kinds of faults. On the command line their names are written as `drop-mid-scan=17`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// The connection is cut before this many columns were sent, once.
    DropMidScan,
    /// Every connection is cut after so many columns.
    DropOften,
    /// The bridge dies before this many columns were sent and starts again without its scans.
    BridgeKilled,
    /// After a cut nobody is let in for so many milliseconds.
    ReconnectTooFast,
    /// The connection is cut when the first Start has come, before its answer.
    ReplyLost,
    /// Every column comes so many milliseconds late.
    Slow,
    /// Once, in the middle of a scan, nothing is said for so many milliseconds.
    Stalled,
    /// A bit flips in one of so many columns.
    CorruptFrame,
    /// A bit flips in the first ScanEnd.
    CorruptEnd,
    /// A bit flips in the header before this column, once.
    CorruptHeader,
    /// A frame of 2 MiB is announced before this column, once.
    Oversize,
    /// One of so many columns is not sent the first time.
    MissingColumn,
    /// Columns come in random order within so many.
    Shuffled,
    /// One of so many columns comes twice.
    Repeated,
    /// Frames of another scan come between the columns.
    LateFrames,
    /// A column without a payload comes before this column.
    ZeroLength,
    /// A column comes again with other content.
    TornColumn,
    /// The digest is not that of the columns.
    WrongDigest,
    /// ScanEnd never comes.
    EventLost,
    /// A frame of an unknown type that may be skipped comes before this column.
    UnknownFrame,
    /// A frame of an unknown type that must be understood comes before this column.
    UnknownCommand,
    /// The bridge speaks version 2.
    VersionMismatch,
    /// Somebody else holds the lease for so many milliseconds.
    LeaseStuck,
    /// The scanner is off or starting up for so many milliseconds.
    Asleep,
    /// Capabilities come so many milliseconds late, the first time.
    ConnectLate,
    /// The mirror does not come up to speed so many times; after five the scanner gives up.
    StartStall,
    /// The status says `ready` at all times.
    StaleStatus,
    /// The progress stays at 0, then is 1.
    ProgressJump,
    /// The scanner takes another measuring rate than asked for.
    ParamsAltered,
    /// The bridge's disk holds so many kilobytes.
    Overflow,
    /// The vendor's library is not registered on the bridge's computer.
    SdkMissing,
    /// There is no card in the scanner.
    CardMissing,
    /// The card is full after this many columns.
    StorageFull,
    /// The battery is low: a warning.
    BatteryLow,
    /// It is 46 degrees warm: a warning.
    Temperature,
    /// The mirror is dirty: a warning.
    Contamination,
    /// The scanner is pushed after this many columns, notices and stops.
    Tilted,
    /// Another scanner answers.
    WrongScanner,
    /// The scanner's clock says 1970, and falls back to 0 in the middle.
    ClockJump,
}

impl FromStr for Fault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, number) = text.split_once('=').unwrap_or((text, "1"));
        let kind =
            FaultKind::deserialize(name.into_deserializer()).map_err(|error: Unknown| error.to_string())?;
        let number =
            number.parse().map_err(|_| format!("{text}: write {name}=NUMBER with a whole number"))?;
        Ok(Self { kind, number })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_named_or_refused() {
        let fault = |kind, number| Ok(Fault { kind, number });
        assert_eq!("drop-mid-scan=17".parse(), fault(FaultKind::DropMidScan, 17));
        assert_eq!("wrong-digest".parse(), fault(FaultKind::WrongDigest, 1));
        assert!("digest".parse::<Fault>().unwrap_err().contains("wrong-digest"));
        assert!("slow=fast".parse::<Fault>().unwrap_err().contains("slow=NUMBER"));
    }
}
