//! Pseudo terminal as a serial line: the host opens its name, the press uses the other end.
//!
//! A terminal that is not open at the other end reports hang-up permanently, which would keep an event loop busy.
//! Therefore two threads read and write it with blocking calls. The threads, and with them the terminal, end when the
//! press drops its end. The link is removed first, like that of an unplugged adapter, because the terminal's number may
//! be reused a moment later.

use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use std::{io, thread};

use serialport::{SerialPort, TTYPort};
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream, ReadHalf, WriteHalf, duplex, split};
use tokio::runtime::Handle;

/// Time limit of one read, and interval of polling a terminal that is not open.
const LOOK: Duration = Duration::from_millis(10);

/// Creates a terminal, links `device` to it, and returns the press's end.
pub(crate) fn plug(device: &Path) -> io::Result<DuplexStream> {
    let (mut line, host) = TTYPort::pair()?;
    line.set_timeout(LOOK)?;
    let name = host.name().ok_or_else(|| io::Error::other("the terminal has no name"))?;
    relink(&name, device)?;
    let link = Link { device: device.to_path_buf(), terminal: name.into() };
    let (near, far) = duplex(4096);
    let (heard, said) = split(far);
    let mut writer = line.try_clone_native()?;
    let pulled = Arc::new(AtomicBool::new(false));
    let runtime = Handle::current();
    let (also_pulled, also_runtime) = (Arc::clone(&pulled), runtime.clone());
    let also_link = link.clone();
    thread::Builder::new().name("pty write".into()).spawn(move || {
        write_line(&mut writer, heard, &also_runtime, &also_pulled);
        also_link.remove();
    })?;
    thread::Builder::new().name("pty read".into()).spawn(move || {
        read_line(&mut line, said, &runtime, &pulled);
        link.remove();
    })?;
    Ok(near)
}

/// Symbolic link under which the host finds a terminal.
#[derive(Clone)]
struct Link {
    device: PathBuf,
    terminal: PathBuf,
}

impl Link {
    /// Removes the link before either end of the terminal is closed; a link to a newer terminal is kept.
    fn remove(&self) {
        if std::fs::read_link(&self.device).is_ok_and(|terminal| terminal == self.terminal) {
            // An error means that the folder has been removed with the link.
            let _ = std::fs::remove_file(&self.device);
        }
    }
}

/// Replaces the link atomically: it always leads to the old terminal or to the new one.
fn relink(name: &str, device: &Path) -> io::Result<()> {
    let fresh = device.with_extension("new");
    std::os::unix::fs::symlink(name, &fresh)?;
    std::fs::rename(fresh, device)
}

fn read_line(line: &mut TTYPort, mut press: WriteHalf<DuplexStream>, runtime: &Handle, pulled: &AtomicBool) {
    let mut bytes = [0; 512];
    while !pulled.load(Ordering::Relaxed) {
        match line.read(&mut bytes) {
            Ok(n @ 1..) if runtime.block_on(press.write_all(&bytes[..n])).is_err() => return,
            Ok(1..) => {}
            Err(error) if error.kind() == ErrorKind::TimedOut => {}
            // The terminal is not open.
            Ok(0) | Err(_) => thread::sleep(LOOK),
        }
    }
}

fn write_line(line: &mut TTYPort, mut press: ReadHalf<DuplexStream>, runtime: &Handle, pulled: &AtomicBool) {
    let mut bytes = [0; 512];
    while let Ok(n @ 1..) = runtime.block_on(press.read(&mut bytes)) {
        // Bytes on a line that is not open are lost.
        let _ = line.write_all(&bytes[..n]);
    }
    pulled.store(true, Ordering::Relaxed);
}
