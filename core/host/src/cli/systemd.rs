//! Command `platen systemd`: prints the drop-in of the unit `platen@` with the resources that the plant file needs.

use std::fmt::Write as _;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use platen_plant::PlantFile;
use platen_plant::press::{Role, Transport};

use super::{CliError, Common, output};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  platen systemd /etc/platen/press-3.toml\n  \
                        mkdir -p /etc/systemd/system/platen@press-3.service.d\n  \
                        platen systemd /etc/platen/press-3.toml > /etc/systemd/system/platen@press-3.service.d/plant.conf\n  \
                        systemctl daemon-reload && systemctl enable --now platen@press-3\n\n\
                        The unit allows no address, no device and no folder beyond its own record; the drop-in allows those that the plant \
                        file names. Names of hosts are listed as comments: write their addresses.")]
pub(super) struct Command {
    /// Plant file
    plant: PathBuf,
}

pub(super) fn run(common: &Common, command: &Command) -> Result<ExitCode, CliError> {
    let plant = PlantFile::load(&command.plant)?;
    // The unit's own state folder has the name of its plant file.
    let state = Path::new("/var/lib/platen").join(command.plant.file_stem().unwrap_or_default());
    let needs = Needs::of(&plant, &state);
    let text = needs.drop_in(&command.plant);
    output::either(
        common,
        &serde_json::json!({ "addresses": needs.addresses, "names": needs.names, "devices": needs.devices,
        "writes": needs.writes, "drop_in": text }),
        text.trim_end(),
    )?;
    Ok(ExitCode::SUCCESS)
}

/// Resources that a plant file needs beyond those of the unit: addresses, devices, folders.
#[derive(Debug, Default)]
struct Needs {
    /// Addresses; `any` where the host listens for all.
    addresses: Vec<String>,
    /// Host names whose addresses cannot be determined here.
    names: Vec<String>,
    /// Serial lines.
    devices: Vec<PathBuf>,
    /// Folders that are written beside the unit's own folder of state.
    writes: Vec<PathBuf>,
}

impl Needs {
    fn of(plant: &PlantFile, state: &Path) -> Self {
        let mut needs = Self::default();
        match plant.press.as_ref().map(|press| &press.link.transport) {
            Some(Transport::Tcp(socket) | Transport::RtuOverTcp(socket, _)) => {
                // If the host serves the registers, the plant file lists the addresses that may connect.
                match plant.press.as_ref().map(|press| press.role) {
                    Some(Role::Server) => socket.peers.iter().for_each(|peer| needs.host(&peer.to_string())),
                    _ => needs.host(&socket.host),
                }
            }
            Some(Transport::Rtu(line, _)) => needs.devices.push(line.device.clone()),
            None => {}
        }
        for option in plant.scanner.iter().flat_map(|scanner| scanner.options.texts()) {
            if let Some((host, port)) = option.rsplit_once(':')
                && port.parse::<u16>().is_ok()
            {
                needs.host(host);
            }
        }
        if plant.screen.as_ref().is_some_and(|screen| !screen.listen.ip().is_loopback()) {
            // The plant file does not list the computers that read the pages.
            needs.addresses.push("any".into());
        }
        let folders = [Some(plant.output.folder.as_path()), plant.output.history.parent()];
        let calibration = plant.calibration.as_ref().and_then(|it| it.file.parent());
        let store = plant.scan_store.as_ref().map(|store| store.folder.as_path());
        for folder in folders.into_iter().chain([calibration, store]).flatten() {
            if !folder.starts_with(state) && !needs.writes.iter().any(|it| it == folder) {
                needs.writes.push(folder.to_owned());
            }
        }
        needs
    }

    fn host(&mut self, host: &str) {
        let all = [IpAddr::V4(Ipv4Addr::UNSPECIFIED), IpAddr::V6(Ipv6Addr::UNSPECIFIED)];
        let host = host.trim_matches(['[', ']']);
        let address = host.parse::<IpAddr>().or_else(|_| host.parse::<SocketAddr>().map(|it| it.ip()));
        let list = match address {
            Ok(address) if address.is_loopback() => return,
            Ok(address) if all.contains(&address) => {
                self.addresses.push("any".into());
                return;
            }
            Ok(_) => &mut self.addresses,
            Err(_) => &mut self.names,
        };
        if !list.iter().any(|it| it == host) {
            list.push(host.to_owned());
        }
    }

    fn drop_in(&self, plant: &Path) -> String {
        let mut text = format!(
            "# Made by `platen systemd {}`: make it anew after a change there.\n[Service]\n",
            plant.display()
        );
        // Writing to a String cannot fail.
        for address in &self.addresses {
            let _ = writeln!(text, "IPAddressAllow={address}");
        }
        for name in &self.names {
            let _ = writeln!(text, "# write the address of {name}:\n# IPAddressAllow=");
        }
        for device in &self.devices {
            let _ = writeln!(
                text,
                "PrivateDevices=no\nDeviceAllow={} rw\nSupplementaryGroups=dialout",
                device.display()
            );
        }
        for folder in &self.writes {
            let _ = writeln!(text, "ReadWritePaths={}", folder.display());
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn needs(plant: &str, changes: &[(&str, &str)], state: &str) -> Needs {
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
        let text = std::fs::read_to_string(config.join(plant)).unwrap();
        let text = changes.iter().fold(text, |text, (old, new)| {
            assert!(text.contains(old), "{plant} holds no {old}");
            text.replace(old, new)
        });
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("plant.toml");
        std::fs::write(&file, text.replace("\"plates\"", &format!("{:?}", config.join("plates")))).unwrap();
        Needs::of(&PlantFile::load(&file).unwrap(), Path::new(state))
    }

    #[test]
    fn addresses_of_press_and_scanner_but_loopback() {
        let changes =
            [("\"127.0.0.1\"", "\"10.0.0.5\""), ("\"../platen-results\"", "\"/var/lib/platen/a/results\"")];
        let needs = needs("sim-plant.toml", &changes, "/var/lib/platen/a");
        assert_eq!(needs.addresses, ["10.0.0.5"]);
        assert!(needs.names.is_empty() && needs.devices.is_empty() && needs.writes.is_empty(), "{needs:?}");
    }

    #[test]
    fn a_folder_of_another_unit_is_reported() {
        let changes = [("\"../platen-results\"", "\"/var/lib/platen/a/results\"")];
        let needs = needs("sim-plant.toml", &changes, "/var/lib/platen/b");
        assert_eq!(needs.writes, [Path::new("/var/lib/platen/a/results")]);
    }

    #[test]
    fn a_serial_line_is_a_device() {
        let needs = needs("plant-rtu.toml", &[], "/var/lib/platen/a");
        assert_eq!(needs.devices.len(), 1, "{needs:?}");
        assert!(needs.drop_in(Path::new("/etc/platen/a.toml")).contains("DeviceAllow="), "{needs:?}");
    }
}
