//! Command `platen bridge`: conformance tests of a scan bridge over TCP.

use std::net::{SocketAddr, ToSocketAddrs as _};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Args, Subcommand};
use platen_conformance::{BridgeSubject, run_bridge};

use super::{CliError, Common, outcomes};

#[derive(Debug, Args)]
pub(super) struct Command {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Test a bridge against the scan bridge protocol; its scanner turns
    Check(Check),
}

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen bridge check 127.0.0.1:7040\n  \
                        platen bridge check 192.168.43.20:7040 --divisor 16 --rate-kpts 244 --limit-s 300\n  \
                        platen bridge check 127.0.0.1:7040 --only resume --junit bridge.xml\n\n\
                        Up to four scans are made, small ones by default. Nothing else may use the bridge meanwhile.\n\
                        Exit code 0 when no test fails, 1 when one does, 2 when there is nothing to test.")]
struct Check {
    /// Host and port of the bridge
    #[arg(value_name = "HOST:PORT")]
    address: String,
    /// Resolution of the scans, 1/N
    #[arg(long, default_value_t = 32, value_name = "N")]
    divisor: u32,
    /// Measuring rate of the scans, thousands of points per second
    #[arg(long, default_value_t = 122, value_name = "KPTS")]
    rate_kpts: u32,
    /// Azimuths of the scans, degrees wide around 0; everything with 360
    #[arg(long, default_value_t = 20.0, value_name = "DEG")]
    width_deg: f64,
    /// Longest time of a scan, seconds
    #[arg(long, default_value_t = 120, value_name = "S", value_parser = clap::value_parser!(u64).range(1..=3600))]
    limit_s: u64,
    /// Only tests whose names contain this
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// Write the outcomes as JUnit's XML
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let Verb::Check(check) = &command.verb;
    let mut settings =
        serde_json::json!({"divisor": check.divisor, "rate_kpts": check.rate_kpts, "compression": 1});
    if !(check.width_deg > 0.0 && check.width_deg <= 360.0) {
        return Err(CliError::Usage(format!("--width-deg {}: above 0 to 360", check.width_deg)));
    }
    if check.width_deg < 360.0 {
        let width = check.width_deg.to_radians();
        settings["window"] = serde_json::json!({"azimuth_start": -0.5 * width, "azimuth_width": width,
                                                "elevation_min": -1.0, "elevation_max": 0.2});
    }
    let subject = BridgeSubject::new(address(&check.address)?, settings, Duration::from_secs(check.limit_s));
    let mut printed = Ok(());
    let all = run_bridge(&subject, check.only.as_deref(), |outcome| {
        if printed.is_ok() {
            let again = format!("platen bridge check {} --only {}", check.address, outcome.test);
            printed = outcomes::print(common, outcome, &again);
        }
    });
    printed?;
    outcomes::sum(
        common,
        ("bridge", &check.address, "scan bridge protocol 1.0"),
        &all,
        check.junit.as_deref(),
    )
}

fn address(text: &str) -> Result<SocketAddr, CliError> {
    let unknown = |why: String| CliError::Usage(format!("{text}: {why}; such as 192.168.43.20:7040"));
    let mut found = text.to_socket_addrs().map_err(|why| unknown(why.to_string()))?;
    found.next().ok_or_else(|| unknown("no such host".to_owned()))
}
