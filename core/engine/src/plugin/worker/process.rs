//! Process of a worker: the host starts it, puts its output in the log, and ends its whole process group with it.

use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, PipeReader};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, PidfdFlags, Signal, kill_process_group, pidfd_open};

use super::wire::{Socket, timespec};

/// Environment variables that a worker keeps.
const KEPT: [&str; 9] =
    ["PATH", "HOME", "USER", "LANG", "LC_ALL", "TZ", "TMPDIR", "LD_LIBRARY_PATH", "LSAN_OPTIONS"];
/// Lines of output kept for the report on the end of a worker.
const LAST_LINES: usize = 20;
/// Lines of output that reach the log each second.
const LINES: u32 = 1000;
/// Time for the last lines of output to arrive.
const LAST_OUTPUT: Duration = Duration::from_millis(100);
/// Longest line, bytes.
const LINE: u64 = 4096;

#[derive(Debug)]
pub(super) struct Process {
    child: Child,
    last_lines: Arc<Mutex<VecDeque<String>>>,
    pump: thread::JoinHandle<()>,
}

/// Returns the program that has the command `worker`: this one, or `platen` beside it or one folder up (tests,
/// simulators).
fn program() -> io::Result<PathBuf> {
    let this = std::env::current_exe()?;
    if this.file_stem().is_some_and(|name| name == "platen") {
        return Ok(this);
    }
    let beside = this.ancestors().skip(1).take(2).map(|folder| folder.join("platen"));
    beside.into_iter().find(|path| path.is_file()).ok_or_else(|| {
        io::Error::other(format!(
            "the program `platen`, which carries plugins, is not beside {}",
            this.display()
        ))
    })
}

impl Process {
    /// Starts a worker for a library; the log shows its output under `name`.
    pub(super) fn start(name: &str, library: &Path) -> io::Result<(Self, Socket)> {
        let (ours, theirs) = Socket::pair()?;
        let (output, writer) = io::pipe()?;
        let mut command = Command::new(program()?);
        command.arg("worker").arg(name).stdin(theirs.into_fd()).stdout(writer.try_clone()?).stderr(writer);
        command.env_clear().envs(KEPT.iter().filter_map(|key| Some((key, std::env::var_os(key)?))));
        command.process_group(0);
        if let Some(folder) = library.parent().filter(|folder| folder.is_dir()) {
            command.current_dir(folder);
        }
        let child = command.spawn()?;
        drop(command);
        let last_lines = Arc::default();
        let (plugin, kept) = (name.to_owned(), Arc::clone(&last_lines));
        let pump = thread::Builder::new()
            .name(format!("{name} output"))
            .spawn(move || pump(&plugin, output, &kept))?;
        Ok((Self { child, last_lines, pump }, ours))
    }

    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits for the end of a process that is expected to end, then ends the rest of its group. Returns how it ended.
    pub(super) fn end(&mut self, grace: Duration) -> String {
        let group = Pid::from_child(&self.child);
        let by_itself = pidfd_open(group, PidfdFlags::empty()).is_ok_and(|ended| {
            poll(&mut [PollFd::new(&ended, PollFlags::IN)], Some(&timespec(grace))).is_ok_and(|n| n > 0)
        });
        // Until the leader has been waited for, its process identifier is not reused.
        let _ = kill_process_group(group, Signal::KILL);
        let status = self.child.wait();
        // The output ends with the group, unless a process has left the group.
        let until = Instant::now() + LAST_OUTPUT;
        while !self.pump.is_finished() && Instant::now() < until {
            thread::park_timeout(Duration::from_millis(1));
        }
        match status {
            Ok(status) if by_itself => how(status),
            Ok(_) => "it was killed".to_owned(),
            Err(why) => why.to_string(),
        }
    }

    /// Returns the last line of its output.
    pub(super) fn last_line(&self) -> Option<String> {
        self.last_lines.lock().unwrap_or_else(PoisonError::into_inner).back().cloned()
    }
}

/// Returns how a process ended, as readable text.
fn how(status: ExitStatus) -> String {
    let Some(signal) = status.signal() else {
        return format!("exit code {}", status.code().unwrap_or_default());
    };
    let why = match signal {
        libc::SIGSEGV => "SIGSEGV: it used memory that is not its own",
        libc::SIGBUS => "SIGBUS: it used memory that is not there",
        libc::SIGABRT => "SIGABRT: it gave up",
        libc::SIGFPE => "SIGFPE: it divided by zero",
        libc::SIGILL => "SIGILL: an instruction that this processor does not have",
        libc::SIGSYS => "SIGSYS: it made a system call that is closed to it",
        libc::SIGKILL => "SIGKILL: somebody killed it, perhaps the system for lack of memory",
        libc::SIGTERM => "SIGTERM: somebody ended it",
        other => return format!("signal {other}"),
    };
    why.to_owned()
}

/// Passes the output of a worker on to the log.
fn pump(plugin: &str, output: PipeReader, kept: &Mutex<VecDeque<String>>) {
    let mut output = BufReader::new(output);
    let (mut since, mut lines, mut line) = (Instant::now(), 0_u32, Vec::new());
    loop {
        line.clear();
        match io::Read::take(&mut output, LINE).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        let text = printable(String::from_utf8_lossy(&line).trim_end());
        if since.elapsed() > Duration::from_secs(1) {
            if lines > LINES {
                tracing::warn!(target: "plugin", plugin, "{} lines of output are left out", lines - LINES);
            }
            (since, lines) = (Instant::now(), 0);
        }
        lines += 1;
        if lines <= LINES {
            tracing::info!(target: "plugin", plugin, "{text}");
        }
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() == LAST_LINES {
            kept.pop_front();
        }
        kept.push_back(text);
    }
}

/// Returns the text without the characters that control a terminal.
pub(in crate::plugin) fn printable(text: &str) -> String {
    let shown = |c: char| if c.is_control() && c != '\t' { '\u{fffd}' } else { c };
    text.chars().map(shown).collect()
}
