"""A simulated press and a host with pages, as child processes, and browsers to read them."""
import json, os, re, signal, socket, subprocess, tempfile, time, urllib.request
from contextlib import contextmanager
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service

ROOT = Path(__file__).resolve().parents[3]
BIN = ROOT / "target" / "release"
if "CARGO_TARGET_DIR" in os.environ:
    BIN = Path(os.environ["CARGO_TARGET_DIR"]) / "release"


def wait(what, check, limit=20.0):
    """Waits until `check` returns something true, and returns it with the seconds that it took."""
    start = time.monotonic()
    while time.monotonic() - start < limit:
        found = check()
        if found:
            return found, time.monotonic() - start
        time.sleep(0.01)
    raise AssertionError(f"not within {limit} s: {what}")


class Press:
    """The simulated press: strokes on request, over its control port; with `ram`, to ordered depths into a hidden steel, after the blank."""

    def __init__(self, folder, name="C9", automatic=False, ram=False):
        text = (ROOT / "config/sim-press.toml").read_text()
        if ram:
            automatic = True
            text = text.replace('"closed_loop"', '"operator"') + "\n[plate.ram]\nseed = 1\n"
        text = text.replace("seed = 5\n", f"seed = 5\nautomatic = {str(automatic).lower()}\n", 1)
        text = text.replace('part_name = "C9"', f"part_name = {json.dumps(name)}")
        text = text.replace("passes = 1", "passes = 4")
        config = Path(folder) / "press.toml"
        config.write_text(text)
        self.process = subprocess.Popen([BIN / "platen-sim", "press", config, "--modbus-port", "0", "--plate-port", "0", "--with-parent"],
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        ports = json.loads(self.process.stdout.readline())
        self.modbus, self.plate = ports["modbus"], ports["plate"]
        host, port = self.plate.rsplit(":", 1)
        self.control = socket.create_connection((host, int(port))).makefile("rw")

    def ask(self, line):
        self.control.write(json.dumps(line) + "\n")
        self.control.flush()
        return json.loads(self.control.readline())

    def counts(self):
        return self.ask({"get": "counts"})["counts"]

    def stroke(self, what="stroke"):
        """Makes a stroke and waits until its result is accepted; returns the moment of the trigger."""
        before = self.counts()["results"]
        moment = time.monotonic()
        answer = self.ask({"do": what})
        assert answer.get("ok"), answer
        wait("result of a stroke", lambda: self.counts()["results"] > before, 60)
        return moment

    def end(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
        self.process.wait()


class Host:
    """`platen run` with pages on a free port, or on `port`."""

    def __init__(self, folder, press, port=0, more="", plate=lambda text: text, listen="127.0.0.1"):
        text = (ROOT / "config/sim-plant.toml").read_text()
        text = text.replace("port = 15020", f"port = {press.modbus.rsplit(':', 1)[1]}").replace("127.0.0.1:15021", press.plate)
        text = text.replace('folder = "../platen-results"', 'folder = "results"')
        folder = Path(folder)
        (folder / "plates").mkdir(exist_ok=True)
        (folder / "plates/plate-009.toml").write_text(plate((ROOT / "config/plates/plate-009.toml").read_text()))
        self.plant = folder / "plant.toml"
        self.plant.write_text(f'{text}\n[screen]\nlisten = "{listen}:{port}"\n{more}')
        self.log = open(folder / "host.log", "a")
        self.process = subprocess.Popen([BIN / "platen", "run", self.plant], stdout=subprocess.PIPE, stderr=self.log, text=True)
        line = self.process.stdout.readline()
        found = re.match(r"pages: (http://\S+)/$", line.strip())
        assert found, f"platen run said {line!r}; see {folder / 'host.log'}"
        self.address = found[1]
        self.port = int(self.address.rsplit(":", 1)[1])
        token = re.search(r'token_file = "(.*)"', more)
        self.headers = {"Authorization": f"Bearer {Path(token[1]).read_text().strip()}"} if token else {}
        wait("ready", lambda: self.state()["press"]["ready"], 30)

    def get(self, path):
        with urllib.request.urlopen(urllib.request.Request(self.address + path, headers=self.headers), timeout=10) as answer:
            return answer.read()

    def state(self):
        return json.loads(self.get("/api/v1/state"))

    def end(self, how=signal.SIGTERM):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.send_signal(how)
        self.process.wait(30)


@contextmanager
def cell(name="C9", strokes=0, ram=False, **host):
    """A press and a host in a folder of their own, after a blank and some strokes."""
    with tempfile.TemporaryDirectory() as folder:
        press = Press(folder, name, ram=ram)
        host = Host(folder, press, **host)
        try:
            for k in range(strokes):
                press.stroke("baseline" if k == 0 else "stroke")
            yield press, host
        finally:
            host.end()
            press.end()


def chromium(width=1280, height=800, driver=None):
    """A headless Chromium whose page has this size; started by a driver elsewhere, or by one of its own."""
    options = Options()
    options.binary_location = "/usr/bin/chromium"
    for argument in ["--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
                     "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--force-color-profile=srgb",
                     "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--js-flags=--expose-gc"]:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    if driver:
        browser = webdriver.Remote(command_executor=driver, options=options)
    else:
        browser = webdriver.Chrome(options=options, service=Service("/usr/bin/chromedriver"))
        resize(browser, width, height)
    return browser


def resize(browser, width, height):
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                            {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False})


def shown(browser):
    """Texts and pictures that the page shows, by id."""
    return browser.execute_script("""
        const all = {};
        for (const e of document.querySelectorAll('span[id], p[id]')) all[e.id] = e.textContent;
        for (const e of document.querySelectorAll('img[id]')) all[e.id] = e.getAttribute('src') ?? '';
        return all;""")


def settled(browser):
    """Waits until every picture of the page is drawn."""
    wait("pictures", lambda: browser.execute_script(
        "return [...document.images].every(i => !i.getAttribute('src') || (i.complete && i.naturalWidth > 0))"))
