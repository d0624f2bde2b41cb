//! A simulated press and the real host as processes, over real sockets.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value as Json;

/// Longest wait for anything, against tests that hang: twenty strokes take a minute and a half on a machine that is busy otherwise.
pub(crate) const LIMIT: Duration = Duration::from_secs(300);

/// Asks `ready` again until it answers; panics with `what` after [`LIMIT`].
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

/// `platen-sim press` with its second port.
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

    /// Waits until `count` results were taken.
    pub(crate) fn wait_taken(&mut self, count: usize) -> Json {
        until("a result", || {
            let stats = self.stats();
            (stats["taken"].as_array().unwrap().len() >= count).then_some(stats)
        })
    }

    pub(crate) fn wait_done(&mut self) -> Json {
        until("the end of the strokes", || Some(self.stats()).filter(|stats| stats["done"] == true))
    }

    /// Status word of the host's block.
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

/// A host that was killed may take long to come back on a busy machine: the press waits for it. The blank is as shops cut them: 4 mm
/// too long, 3 mm too narrow, out of square, one edge bowed.
const PLATE: &str = "\n[timings]\ndown_ms = 20\nup_ms = 20\nbetween_ms = 10\nhost_ms = 60000\n\
    [plate]\ntarget = { shape = \"cylinder\", radius_mm = 9018.0, axis_deg = 90.0 }\n\
    [plate.blank]\nwidth_mm = 3000.0\nheight_mm = 2500.0\nthickness_mm = 36.0\n\
    corners_off_mm = [[-3.0, 0.75], [1.0, 2.25], [3.0, -0.75], [-1.0, -2.25]]\nbows_mm = [0.0, 2.0, 0.0, 0.0]\n";

/// A plant for that press in a folder of its own; `scanner` are the simulated scanner's further options.
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

/// `platen run` on a plant file.
pub(crate) struct Host {
    child: Child,
    plant: PathBuf,
}

impl Host {
    pub(crate) fn start(plant: &Path) -> Self {
        Self::run(platen_tests::program("platen"), plant)
    }

    /// A host that finds its plugins in `plugins` first.
    pub(crate) fn with_plugins(plant: &Path, plugins: &Path) -> Self {
        let mut program = platen_tests::program("platen");
        program.arg("--plugins").arg(plugins);
        Self::run(program, plant)
    }

    /// Number of its process.
    pub(crate) fn process(&self) -> u32 {
        self.child.id()
    }

    /// A host on a full disk: it cannot write any file beyond so many bytes.
    pub(crate) fn on_full_disk(plant: &Path, file_bytes: u32) -> Self {
        let library = plant.with_file_name("libfull_disk.so");
        platen_tests::compile_c(&platen_tests::c_source("full_disk.c"), &library, &["-shared", "-fPIC"]);
        let mut program = platen_tests::program("platen");
        program.env("LD_PRELOAD", library).env("FILE_BYTES", file_bytes.to_string());
        Self::run(program, plant)
    }

    /// A host that systemd would have started, with this socket to tell it.
    pub(crate) fn notifying(plant: &Path, socket: &Path) -> Self {
        let mut program = platen_tests::program("platen");
        program.env("NOTIFY_SOCKET", socket);
        Self::run(program, plant)
    }

    /// A host whose realtime clock is off by the seconds in the file `shift`.
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

    /// Ends it with SIGTERM and gives its exit code.
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

    /// `platen status --json`, once there is one.
    pub(crate) fn status(&self) -> Option<Json> {
        let output =
            platen_tests::program("platen").arg("status").arg(&self.plant).arg("--json").output().unwrap();
        serde_json::from_slice(&output.stdout).ok()
    }

    /// `platen history list --json`.
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

/// Acts that are forbidden to every host, as counted by the press.
#[track_caller]
pub(crate) fn assert_clean(stats: &Json, log: &str) {
    let writes = ["writes_outside", "writes_before_sync", "writes_while_void"];
    for count in writes.into_iter().chain(["wrong_values", "duplicates", "changed"]) {
        assert_eq!(stats[count], 0, "{count}: {stats:#}\n{log}");
    }
}
