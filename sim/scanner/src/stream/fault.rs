//! Faults of link, bridge and scanner, by name.

use std::str::FromStr;

use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error as Unknown;

/// Fault of link, bridge or scanner. The parameter `number` is a column, a share (one in n) or milliseconds, as defined
/// by the kind; 1 by default.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// Kind of fault.
    pub kind: FaultKind,
    /// Parameter n of the kind.
    pub number: u32,
}

/// Kinds of faults with their parameter n. On the command line: `drop-mid-scan=17`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// Cuts the connection after n columns, once.
    DropMidScan,
    /// Cuts every connection after n columns.
    DropOften,
    /// Restarts the bridge after n columns, without its scans, once.
    BridgeKilled,
    /// Refuses connections for n milliseconds after a cut.
    ReconnectTooFast,
    /// Cuts the connection after the first Start, before its answer.
    ReplyLost,
    /// Delays every column by n milliseconds.
    Slow,
    /// Stops sending for n milliseconds in the middle of a scan, once.
    Stalled,
    /// Flips a bit in the payload of one in n columns.
    CorruptFrame,
    /// Flips a bit in the first ScanEnd.
    CorruptEnd,
    /// Flips a bit in a header before column n, once.
    CorruptHeader,
    /// Announces a frame of 2 MiB before column n, once.
    Oversize,
    /// Omits one in n columns the first time.
    MissingColumn,
    /// Shuffles columns within groups of n.
    Shuffled,
    /// Sends one in n columns twice.
    Repeated,
    /// Inserts frames of another scan between the columns.
    LateFrames,
    /// Sends a Column frame without payload before column n, once.
    ZeroLength,
    /// Repeats a column with other content after n columns, once.
    TornColumn,
    /// Sends a wrong digest in ScanEnd.
    WrongDigest,
    /// Never sends ScanEnd.
    EventLost,
    /// Sends a non-critical frame of an unknown type before column n, once.
    UnknownFrame,
    /// Sends a critical frame of an unknown type before column n, once.
    UnknownCommand,
    /// Sends frames of version 2.
    VersionMismatch,
    /// Another client holds the lease for the first n milliseconds.
    LeaseStuck,
    /// The scanner is off or starting up for the first n milliseconds.
    Asleep,
    /// Delays the first Capabilities by n milliseconds.
    ConnectLate,
    /// The mirror fails to reach its speed n times; the scan fails when n exceeds five.
    StartStall,
    /// Status always reports `ready`.
    StaleStatus,
    /// The progress in Status stays at 0.
    ProgressJump,
    /// The scanner sets half the requested measuring rate.
    ParamsAltered,
    /// The bridge's disk is full after n kilobytes.
    Overflow,
    /// The vendor's library is not registered on the bridge's computer.
    SdkMissing,
    /// The scanner has no memory card.
    CardMissing,
    /// The memory card is full after n columns.
    StorageFull,
    /// Status warns of a low battery.
    BatteryLow,
    /// Status warns of a temperature of 46 degrees C.
    Temperature,
    /// Status warns of a contaminated mirror.
    Contamination,
    /// The scanner is moved after n columns, detects it and stops.
    Tilted,
    /// Another scanner, with another serial number, answers.
    WrongScanner,
    /// The scanner's clock is at 1970 and falls back to 0 during the scan.
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
