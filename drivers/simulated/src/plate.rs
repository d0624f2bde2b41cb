//! Source of the plate: simulated press, description file, or options.

use crate::Options;
use crate::error::Error;
use nalgebra::{Isometry3, Translation3, Vector3};
use platen_sim_plate::{PlateState, Pose, Reply, Request, Shape};
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// Time limit of connecting, sending and receiving.
const TIMEOUT: Duration = Duration::from_secs(2);

/// Longest accepted reply, bytes.
const LONGEST_ANSWER: u64 = 1 << 20;

/// Refuses options that contradict each other.
pub(crate) fn check(options: &Options) -> Result<(), Error> {
    if options.cell.is_some() && options.plate_file.is_some() {
        return Err(Error::Options("the options cell and plate_file are both set; remove one".into()));
    }
    if options.scanner_m.as_ref().is_some_and(|position| position.len() != 3) {
        return Err(Error::Options("scanner_m: write three numbers: x, y, z in metres".into()));
    }
    Ok(())
}

/// Fetches the present state of the plate in the scanner's frame; `None` when the press is empty.
pub(crate) fn fetch(options: &Options) -> Result<Option<PlateState>, Error> {
    let state = match (&options.cell, &options.plate_file) {
        (Some(address), _) => ask(address)?,
        (None, Some(path)) => {
            let text =
                std::fs::read_to_string(path).map_err(|source| Error::File { path: path.clone(), source })?;
            let described =
                |error: toml::de::Error| Error::Description { path: path.clone(), message: one_line(&error) };
            Some(toml::from_str(&text).map_err(described)?)
        }
        (None, None) => Some(own(options)),
    };
    Ok(state.map(|state| PlateState { pose: seen_from(options, &state.pose), ..state }))
}

/// Returns a TOML error as one line: place and message.
fn one_line(error: &toml::de::Error) -> String {
    error.to_string().lines().map(str::trim).filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Returns the plate described by the options.
fn own(options: &Options) -> PlateState {
    let Options { radius_mm, axis_deg, .. } = *options;
    let shape = match options.shape.as_str() {
        "cylinder" => Shape::Cylinder { radius_mm, axis_deg },
        "sphere" => Shape::Sphere { radius_mm },
        _ => Shape::Flat,
    };
    PlateState { shape, ..PlateState::flat(options.width_mm, options.height_mm, options.thickness_mm) }
}

/// Transforms a pose to the frame of a scanner at another position.
fn seen_from(options: &Options, pose: &Pose) -> Pose {
    let Some(&[x, y, z]) = options.scanner_m.as_deref().or(Some(&[0.0; 3])) else { return *pose };
    let turn = Vector3::z() * options.scanner_yaw_deg.to_radians();
    let cell_from_scanner =
        Isometry3::from_parts(Translation3::new(x, y, z), nalgebra::UnitQuaternion::new(turn));
    let seen = cell_from_scanner.inverse() * pose.scanner_from_plate();
    Pose::from_parts(&seen.rotation.to_rotation_matrix(), seen.translation.vector)
}

/// Requests the plate from the simulated press.
fn ask(address: &str) -> Result<Option<PlateState>, Error> {
    let failed = |source| Error::Cell { address: address.into(), source };
    let line = exchange(address).map_err(failed)?;
    match serde_json::from_str(&line) {
        Ok(Reply::Plate(state)) => Ok(state.map(|state| *state)),
        Ok(Reply::Error(reason)) => Err(Error::Busy { address: address.into(), reason }),
        Err(source) => {
            let line = line.trim_end().chars().take(80).collect();
            Err(Error::Answer { address: address.into(), line, source })
        }
    }
}

/// Sends one request and returns the line of the reply.
fn exchange(address: &str) -> std::io::Result<String> {
    let nowhere = || std::io::Error::new(std::io::ErrorKind::NotFound, "the name has no address");
    let resolved = address.to_socket_addrs()?.next().ok_or_else(nowhere)?;
    let mut stream = TcpStream::connect_timeout(&resolved, TIMEOUT)?;
    stream.set_read_timeout(Some(TIMEOUT))?;
    stream.set_write_timeout(Some(TIMEOUT))?;
    stream.set_nodelay(true)?;
    let mut request = serde_json::to_string(&Request::Plate)?;
    request.push('\n');
    stream.write_all(request.as_bytes())?;
    let mut line = String::new();
    BufReader::new(std::io::Read::take(stream, LONGEST_ANSWER)).read_line(&mut line)?;
    if line.is_empty() {
        return Err(std::io::Error::new(
            std::io::ErrorKind::UnexpectedEof,
            "the connection was closed without an answer",
        ));
    }
    Ok(line)
}
