//! Test cell of a simulated press and the real host as processes, over real sockets.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value as Json;

/// Longest wait for anything, against tests that hang: twenty strokes take a minute and a half on a machine that is
/// otherwise busy.
pub(crate) const LIMIT: Duration = Duration::from_secs(300);

/// Calls `ready` until it returns a value; panics with `what` after [`LIMIT`].
#[track_caller]
pub(crate) fn until<T>(what: &str, mut ready: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + LIMIT;
    loop {
        if let Some(value) = ready() {
            return value;
        }
        assert!(Instant::now() < end, "{what} did not come");
        std::thread::park_timeout(Duration::from_millis(10));
    }
}

/// Process `platen-sim press` with its second port.
pub(crate) struct Press {
    child: Child,
    pub(crate) modbus: String,
    pub(crate) plate: String,
    line: BufReader<TcpStream>,
}

impl Press {
    /// Starts a press; `config` are lines of TOML on top of a quick press with the plate of recipe 9.
    pub(crate) fn start(folder: &Path, config: &str) -> Self {
        let file = folder.join("press.toml");
        std::fs::write(&file, format!("press_id = 3\nrecipe_id = 9\n{config}\n{PLATE}")).unwrap();
        let mut child = platen_tests::program("platen-sim")
            .arg("press")
            .arg(&file)
            .arg("--with-parent")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let ports: Json = serde_json::from_str(&line).unwrap();
        let port = |name: &str| ports[name].as_str().unwrap().to_owned();
        let (modbus, plate) = (port("modbus"), port("plate"));
        let stream = TcpStream::connect(&plate).unwrap();
        Self { child, modbus, plate, line: BufReader::new(stream) }
    }

    pub(crate) fn ask(&mut self, question: &str) -> Json {
        writeln!(self.line.get_mut(), "{question}").unwrap();
        let mut answer = String::new();
        self.line.read_line(&mut answer).unwrap();
        serde_json::from_str(&answer).unwrap()
    }

    pub(crate) fn stats(&mut self) -> Json {
        self.ask(r#"{"get":"stats"}"#)["stats"].take()
    }

    /// Waits until `count` results were accepted.
    pub(crate) fn wait_taken(&mut self, count: usize) -> Json {
        until("a result", || {
            let stats = self.stats();
            (stats["taken"].as_array().unwrap().len() >= count).then_some(stats)
        })
    }

    pub(crate) fn wait_done(&mut self) -> Json {
        until("the end of the strokes", || Some(self.stats()).filter(|stats| stats["done"] == true))
    }

    /// Returns the status word of the host's block.
    pub(crate) fn host_status(&mut self) -> u64 {
        self.ask(r#"{"get":"registers"}"#)["registers"]["h"][2].as_u64().unwrap()
    }
}

impl Drop for Press {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A killed host may take long to restart on a busy machine: the press waits for it. The blank has typical cutting
/// errors: 4 mm too long, 3 mm too narrow, out of square, one edge bowed.
const PLATE: &str = "\n[timings]\ndown_ms = 20\nup_ms = 20\nbetween_ms = 10\nhost_ms = 60000\n\
    [plate]\ntarget = { shape = \"cylinder\", radius_mm = 9018.0, axis_deg = 90.0 }\n\
    [plate.blank]\nwidth_mm = 3000.0\nheight_mm = 2500.0\nthickness_mm = 36.0\n\
    corners_off_mm = [[-3.0, 0.75], [1.0, 2.25], [3.0, -0.75], [-1.0, -2.25]]\nbows_mm = [0.0, 2.0, 0.0, 0.0]\n";

/// Writes a plant for that press in a folder of its own; `scanner` are the simulated scanner's further options.
pub(crate) fn plant(folder: &Path, modbus: &str, scanner: &str) -> PathBuf {
    let plates = platen_tests::repository().join("config/plates");
    let port = modbus.rsplit(':').next().unwrap();
    let text = format!(
        "[plant]\nname = \"test\"\n[press]\nname = \"press\"\npress_id = 3\n\
         [press.link]\ntype = \"tcp\"\nhost = \"127.0.0.1\"\nport = {port}\nunit = 1\n\
         [scanner]\nplugin = \"simulated\"\n[scanner.options]\nstep_deg = 0.1\n{scanner}\n\
         [frame]\nu_axis = [1.0, 0.0, 0.0]\n[plates]\nfolder = {plates:?}\n\
         [flattening]\nplugin = \"harmonic\"\n[[comparison]]\nplugin = \"template\"\n\
         [output]\nfolder = \"results\"\n"
    );
    let path = folder.join("plant.toml");
    std::fs::write(&path, text).unwrap();
    path
}

/// Process `platen run` on a plant file.
pub(crate) struct Host {
    child: Child,
    plant: PathBuf,
}

impl Host {
    pub(crate) fn start(plant: &Path) -> Self {
        Self::run(platen_tests::program("platen"), plant)
    }

    /// Starts a host that searches `plugins` first.
    pub(crate) fn with_plugins(plant: &Path, plugins: &Path) -> Self {
        let mut program = platen_tests::program("platen");
        program.arg("--plugins").arg(plugins);
        Self::run(program, plant)
    }

    /// Returns its process identifier.
    pub(crate) fn process(&self) -> u32 {
        self.child.id()
    }

    /// Starts a host on a full disk: it cannot write a file larger than `file_bytes`.
    pub(crate) fn on_full_disk(plant: &Path, file_bytes: u32) -> Self {
        let library = plant.with_file_name("libfull_disk.so");
        platen_tests::compile_c(&platen_tests::c_source("full_disk.c"), &library, &["-shared", "-fPIC"]);
        let mut program = platen_tests::program("platen");
        program.env("LD_PRELOAD", library).env("FILE_BYTES", file_bytes.to_string());
        Self::run(program, plant)
    }

    /// Starts a host as systemd would, with this socket for its notifications.
    pub(crate) fn notifying(plant: &Path, socket: &Path) -> Self {
        let mut program = platen_tests::program("platen");
        program.env("NOTIFY_SOCKET", socket);
        Self::run(program, plant)
    }

    /// Starts a host whose realtime clock is off by the seconds in the file `shift`.
    pub(crate) fn with_shifted_clock(plant: &Path, shift: &Path) -> Self {
        let library = plant.with_file_name("libshifted_clock.so");
        let arguments = ["-shared", "-fPIC", "-Wno-pedantic"];
        platen_tests::compile_c(&platen_tests::c_source("shifted_clock.c"), &library, &arguments);
        let mut program = platen_tests::program("platen");
        program.env("LD_PRELOAD", library).env("CLOCK_SHIFT", shift);
        Self::run(program, plant)
    }

    fn run(mut program: Command, plant: &Path) -> Self {
        let log =
            std::fs::File::options().create(true).append(true).open(plant.with_extension("log")).unwrap();
        let child =
            program.arg("run").arg(plant).arg("--json").stdout(Stdio::null()).stderr(log).spawn().unwrap();
        Self { child, plant: plant.to_path_buf() }
    }

    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    pub(crate) fn signal(&self, name: &str) {
        let done = Command::new("kill").args([&format!("-{name}"), &self.child.id().to_string()]).status();
        assert!(done.unwrap().success());
    }

    /// Ends it with SIGTERM and returns its exit code.
    pub(crate) fn stop(&mut self) -> Option<i32> {
        self.signal("TERM");
        until("the end of the host", || self.child.try_wait().unwrap()).code()
    }

    /// Waits until it ends on its own.
    pub(crate) fn wait(&mut self) -> Option<i32> {
        until("the end of the host", || self.child.try_wait().unwrap()).code()
    }

    pub(crate) fn log(&self) -> String {
        std::fs::read_to_string(self.plant.with_extension("log")).unwrap_or_default()
    }

    /// Returns the output of `platen status --json`, once there is one.
    pub(crate) fn status(&self) -> Option<Json> {
        let output =
            platen_tests::program("platen").arg("status").arg(&self.plant).arg("--json").output().unwrap();
        serde_json::from_slice(&output.stdout).ok()
    }

    /// Returns the output of `platen history list --json`.
    pub(crate) fn history(plant: &Path) -> Vec<Json> {
        let output = platen_tests::program("platen")
            .args(["history", "list", "--newest", "100000", "--json"])
            .arg(plant)
            .output()
            .unwrap();
        serde_json::from_slice(&output.stdout).unwrap()
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Asserts that no act occurred that is forbidden to every host, as counted by the press.
#[track_caller]
pub(crate) fn assert_clean(stats: &Json, log: &str) {
    let writes = ["writes_outside", "writes_before_sync", "writes_while_void"];
    for count in writes.into_iter().chain(["wrong_values", "duplicates", "changed"]) {
        assert_eq!(stats[count], 0, "{count}: {stats:#}\n{log}");
    }
}
