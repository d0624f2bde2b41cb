"""The pages of a running host in Debian's Chromium: what an operator sees, and that it is never an old pass.

Runs the release build's `platen run` beside `platen-sim press`, both as child processes. Every check prints one line; the first that
fails ends the program with exit code 1. `--bless` writes the screenshots of tests/golden/screen anew; `--only WORD` runs some checks.
"""
import argparse, io, json, math, os, re, signal, socket, ssl, statistics, subprocess, sys, tempfile, threading, time, urllib.error, urllib.request
from contextlib import contextmanager
from pathlib import Path

import jsonschema
from PIL import Image, ImageChops
from selenium.common.exceptions import WebDriverException
from selenium.webdriver.common.keys import Keys

from cell import BIN, ROOT, Host, Press, cell, chromium, resize, settled, shown, wait
from firefox import Firefox

GOLDEN = ROOT / "tests/golden/screen"
RESULT = ["left", "near", "gap-title", "gap", "gap-more", "limit", "map", "overlay"]
WORDS = {"BEND MORE", "BENT TOO FAR", "DONE", "OUT OF TOLERANCE"}
PAGES = ["/", "/strokes", "/strokes?plate=1", "/compare?a=1&b=2", "/engineer", "/plate?run=2"]
ADVICE = """[advice]
plugin = "line-bends"
show = "screen"
deadline_ms = 30000
[[die]]
id = 4
opening_mm = 360.0
"""
# A 10-inch panel of 1280 x 800 is 136 mm high.
MM = 800 / 136
arguments = None


def said(text):
    print(f"  {text}", flush=True)


def nothing_is_left(browser):
    """No verdict, place or number of a result stands in the document."""
    page = shown(browser)
    text = browser.execute_script("return document.body.innerText")
    left = [name for name in RESULT if page.get(name)] + [word for word in WORDS if word in text]
    return not left


def gone_after(browser, act, limit):
    """Acts, and returns the seconds until nothing of the result is left."""
    act()
    _, took = wait("the result has left the page", lambda: nothing_is_left(browser), 10)
    assert took < limit, f"after {took:.2f} s, allowed {limit}"
    return took


def opened(browser, host, path="/"):
    browser.get(host.address + path)
    if path.split("?")[0] == "/":
        wait("a result on the page", lambda: shown(browser)["gap"], 10)


def passes(plate):
    """The plate file with limits under which the blank passes."""
    return re.sub(r"limit_mm = [0-9.]+", "limit_mm = 300.0", plate)


def check_a_person_sees_what_to_do(browser):
    """Stroke by stroke: verdict, place and gap; the figures are those of result.json, report and registers."""
    with cell(strokes=3) as (press, host):
        opened(browser, host)
        state, page = host.state(), shown(browser)
        assert page["verdict"] == "BEND MORE", page
        record = json.loads(host.get(f"/api/v1/strokes/{state['result']['run']}"))
        templates = [t for line in record["reference_lines"] for t in line["templates"]]
        worst = max(templates, key=lambda t: abs(t["max_gap_mm"]) / t["limit_mm"])
        assert page["gap"] == f"{worst['max_gap_mm']:.1f}" and page["gap-more"].startswith("\u00b1 "), (page["gap"], worst["max_gap_mm"])
        assert page["limit"] == f"(limit {worst['limit_mm']:.1f} mm)"
        report = host.get("/plates/1/report.html").decode()
        assert f"{worst['max_gap_mm']:.1f} \u00b1" in report
        registers = {row["name"]: row["value"] for row in json.loads(host.get("/api/v1/engineer"))["registers"][1]}
        assert f"{float(registers['gap_max'].split()[0]):.1f}" == page["gap"], registers["gap_max"]
        if record["next"] and record["next"].get("at_mm"):
            u, v = record["next"]["at_mm"]
            side = record["plate_file"]["press_side"]
            left = {(0, 1): record["plate_file"]["width_mm"] - u}.get(tuple(side) if side else None, u)
            assert page["left"] == f"{left / 1000:.1f} m", (page["left"], record["next"])
        said(f"{page['verdict']}; {page['place-title']}: {page['left']} {page['left-words']}, {page['near']} {page['near-words']}; {page['gap']} {page['gap-more']} {page['limit']}")


def heading(host):
    """The heading over the place of the next hit, from the record's bends; None where there is no place."""
    state, _ = wait("the result", lambda: (s := host.state())["result"] and s)
    place = (state["result"]["next"] or {}).get("at_mm")
    if not place:
        return None

    def holds(bend):
        turn = math.radians(bend["direction_deg"])
        x, y = place[0] - bend["at_mm"][0], place[1] - bend["at_mm"][1]
        return (abs(x * math.cos(turn) + y * math.sin(turn)) <= bend["length_mm"] / 2
                and abs(y * math.cos(turn) - x * math.sin(turn)) <= bend["width_mm"] / 2)

    strokes = json.loads(host.get("/api/v1/plates/1/sequence"))["strokes"]
    again = any(holds(bend) for stroke in strokes for bend in stroke["bends"] or [])
    return "PRESS HERE AGAIN" if again else "PRESS HERE"


def check_a_place_bent_before_is_told(browser):
    """The heading says "again" exactly where a bend of the record lies on the place."""
    with cell(strokes=1) as (press, host):
        opened(browser, host)
        told = []
        for _ in range(9):
            press.stroke()
            wanted = heading(host)
            if wanted:
                wait(wanted, lambda: shown(browser)["place-title"] == wanted, 5)
                told.append(wanted)
        said(f"{len(told)} places, {told.count('PRESS HERE AGAIN')} of them bent before")
        assert len(set(told)) == 2


def check_every_event_is_of_the_schema(_):
    """Every state of a blank and two strokes against core/screen/schema, and none over 8 kB."""
    schema = jsonschema.Draft202012Validator(json.loads((ROOT / "core/screen/schema/platen.screen-1.json").read_text()))
    with cell() as (press, host):
        events = []

        def read():
            with urllib.request.urlopen(host.address + "/api/v1/stream", timeout=30) as stream:
                for line in stream:
                    if line.startswith(b"data: ") and b"platen.screen/1" in line:
                        events.append(line[6:])

        threading.Thread(target=read, daemon=True).start()
        for what in ["baseline", "stroke", "stroke"]:
            press.stroke(what)
        wait("a result", lambda: b'"verdict"' in events[-1], 10)
        for event in events:
            faults = list(schema.iter_errors(json.loads(event)))
            assert not faults, faults[0]
            assert len(event) <= 8192
        stages = [stage for stage in ("accepted", "scanning", "measuring", "done") if any(f'"stage":"{stage}"'.encode() in e for e in events)]
        said(f"{len(events)} states, at most {max(map(len, events))} bytes; stages seen: {', '.join(stages)}")


def check_a_dead_host_leaves_no_result(browser):
    """kill -9, SIGSTOP, a closed lid: within 2 s no verdict, place or number."""
    with cell(strokes=2, plate=passes) as (press, host):
        opened(browser, host)
        assert shown(browser)["verdict"] == "DONE", shown(browser)
        said(f"SIGSTOP of the host: gone after {gone_after(browser, lambda: host.process.send_signal(signal.SIGSTOP), 2.0):.2f} s")
        assert "NO CONNECTION" in shown(browser)["verdict"]
        host.process.send_signal(signal.SIGCONT)
        _, took = wait("the result is back", lambda: shown(browser)["gap"], 10)
        said(f"SIGCONT: back after {took:.2f} s")

        # A lid: the page is hidden, the host stands meanwhile, the page is shown again.
        page = browser.current_window_handle
        browser.switch_to.new_window("tab")
        host.process.send_signal(signal.SIGSTOP)
        browser.switch_to.window(page)
        said(f"shown again while the host stands: gone after {gone_after(browser, lambda: None, 1.0):.2f} s")
        host.process.send_signal(signal.SIGCONT)
        wait("the result is back", lambda: shown(browser)["gap"], 10)
        said(f"kill -9: gone after {gone_after(browser, lambda: host.process.send_signal(signal.SIGKILL), 2.0):.2f} s")
        host.process.wait()

        # The same host again, as of another version: the page loads itself anew.
        browser.execute_script("window.before = true")
        again = Host(host.plant.parent, press, port=host.port)
        try:
            start = time.monotonic()
            wait("the page has loaded itself", lambda: not browser.execute_script("return window.before === true"), 10)
            wait("it says the state", lambda: shown(browser)["verdict"] not in ("", "NO CONNECTION"), 10)
            said(f"restarted: loaded and says {shown(browser)['verdict']!r} {time.monotonic() - start:.2f} s after the host was ready")
        finally:
            again.end()


def check_a_stroke_takes_the_result_away(browser):
    """The next trigger removes the result with the next event; a press that stands is told."""
    with cell(strokes=2) as (press, host):
        opened(browser, host)
        browser.execute_script("""
            window.moments = [];
            let had = document.getElementById('gap').textContent !== '';
            new MutationObserver(() => {
              const has = document.getElementById('gap').textContent !== '';
              if (has !== had) window.moments.push([has, Date.now()]);
              had = has;
            }).observe(document.body, {subtree: true, childList: true, characterData: true});""")
        hidden, drawn = [], []
        for _ in range(arguments.strokes):
            browser.execute_script("window.moments = []")
            before = press.counts()["results"]
            trigger = time.time()
            answer = press.ask({"do": "stroke"})
            assert answer.get("ok"), answer
            wait("result", lambda: press.counts()["results"] > before, 60)
            accepted = time.time()
            wait("result on the page", lambda: [m for m in browser.execute_script("return window.moments") if m[0]], 10)
            moments = browser.execute_script("return window.moments")
            hidden.append(moments[0][1] / 1000 - trigger)
            drawn.append(moments[-1][1] / 1000 - accepted)
            assert not moments[0][0]
        worst = sorted(hidden)[-1]
        said(f"trigger to hidden: median {statistics.median(hidden) * 1000:.0f}, most {worst * 1000:.0f} ms; "
             f"result in the registers to the page: median {statistics.median(drawn) * 1000:.0f}, most {max(drawn) * 1000:.0f} ms")
        start = time.monotonic()
        press.process.send_signal(signal.SIGSTOP)
        wait("press is told", lambda: shown(browser)["press"] == "Press: no answer", 10)
        said(f"SIGSTOP of the press: told after {time.monotonic() - start:.2f} s")
        assert nothing_is_left(browser)
        press.process.send_signal(signal.SIGCONT)


def check_a_second_engine_obeys_the_rules(_):
    """Firefox ESR: the operator's page, a silent host, the next trigger, a new start."""
    firefox = Firefox()
    try:
        with cell(strokes=2) as (press, host):
            opened(firefox, host)
            said(f"{shown(firefox)['verdict']}, {shown(firefox)['gap']} {shown(firefox)['gap-more']}")
            took = gone_after(firefox, lambda: host.process.send_signal(signal.SIGSTOP), 2.0)
            host.process.send_signal(signal.SIGCONT)
            wait("the result is back", lambda: shown(firefox)["gap"], 10)
            before = press.counts()["results"]
            assert press.ask({"do": "stroke"}).get("ok")
            wait("the trigger hides the result", lambda: nothing_is_left(firefox), 5)
            wait("result", lambda: press.counts()["results"] > before, 60)
            wait("the next result", lambda: shown(firefox)["gap"], 10)
            firefox.execute_script("window.before = true")
            killed = gone_after(firefox, lambda: host.process.send_signal(signal.SIGKILL), 2.0)
            host.process.wait()
            again = Host(host.plant.parent, press, port=host.port)
            wait("the page has loaded itself", lambda: not firefox.execute_script("return window.before === true"), 10)
            again.end()
            said(f"gone after {took:.2f} s of SIGSTOP, {killed:.2f} s after kill -9; the trigger hides it; loads itself anew")
    finally:
        firefox.quit()


def check_names_of_others_are_text(browser):
    """A plate named like markup, from register and plate file: text on every page, no report of the policy, no console error."""
    evil = '"><img onerror=alert(1) src=x>' + "\u202e" * 3000
    named = lambda plate: plate.replace('id = "C9"', f"id = {json.dumps(evil)}")
    with cell(name="<img src=x>", strokes=3, plate=named) as (press, host):
        browser.get_log("browser")
        for path in PAGES:
            browser.get(host.address + path)
            time.sleep(0.5)
            assert not browser.execute_script("return document.querySelector('img[src=x], script:not([src])')")
        assert "<img src=x>" in host.get("/api/v1/plates").decode()
        faults = [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
        assert not faults, faults
        said(f"{len(PAGES)} pages, no fault on the console")


def check_pages_write_nothing(browser):
    """The registers are written as often with every page opened 1,000 times as without."""
    with cell(strokes=2) as (press, host):
        def writes(seconds):
            before = press.counts()
            time.sleep(seconds)
            after = press.counts()
            return {name: after[name] - before[name] for name in after if isinstance(after[name], int) and "write" in name}
        quiet = writes(6)
        start, n = time.monotonic(), 0
        done = threading.Event()
        def read():
            nonlocal n
            for k in range(arguments.reads):
                for path in PAGES + ["/api/v1/state", "/api/v1/engineer", "/metrics"]:
                    host.get(path)
                    n += 1
            done.set()
        threading.Thread(target=read, daemon=True).start()
        busy, spans = {}, 0
        while not done.is_set():
            for name, count in writes(6).items():
                busy[name] = busy.get(name, 0) + count
            spans += 1
        rate = {name: count / spans for name, count in busy.items()}
        said(f"{n} pages in {time.monotonic() - start:.0f} s; writes in 6 s: quiet {quiet}, read {rate}")
        for name in quiet:
            assert rate[name] <= quiet[name] + 1, name


def check_fifty_readers_cost_the_press_little(browser):
    """Strokes alone and beside 50 readers, readers that never read and a port scanner, in turn; figures, and the memory of the host."""
    def memory(host):
        return int(next(line for line in Path(f"/proc/{host.process.pid}/status").read_text().splitlines() if line.startswith("VmRSS")).split()[1]) / 1000

    def load(host, stop):
        ask = f"GET /live/operator HTTP/1.1\r\nHost: 127.0.0.1:{host.port}\r\n\r\n".encode()
        opened = []
        for k in range(100):
            stream = socket.create_connection(("127.0.0.1", host.port))
            stream.sendall(ask)
            stream.setblocking(False)
            opened.append(stream)
        while not stop.wait(0.05):
            for stream in opened[:50]:
                try:
                    stream.recv(65536)
                except OSError:
                    pass
            with socket.create_connection(("127.0.0.1", host.port)) as scanner:
                scanner.sendall(b"\x16\x03\x01\x00\xff nothing that a web server knows")
        for stream in opened:
            stream.close()

    with cell(strokes=2) as (press, host):
        figures, grown = {"alone": [], "beside them": []}, []
        for turn in range(arguments.turns * 2):
            stop = threading.Event()
            name = list(figures)[turn % 2]
            thread = threading.Thread(target=load, args=(host, stop))
            if turn % 2:
                thread.start()
                time.sleep(1)
            n = len(press.ask({"get": "stats"})["stats"]["taken"])
            for _ in range(5):
                press.stroke("rescan")
            figures[name] += press.ask({"get": "stats"})["stats"]["taken"][n:]
            grown.append(memory(host))
            if turn % 2:
                stop.set()
                thread.join()
        for name, taken in figures.items():
            busy, result = ([t[key] for t in taken] for key in ("accepted_ms", "result_ms"))
            said(f"{name}: {len(taken)} strokes, trigger to busy median {statistics.median(busy):.0f}, most {max(busy):.0f} ms; "
                 f"to result median {statistics.median(result):.0f}, most {max(result):.0f} ms")
        said(f"memory of the host after each turn, MB: {', '.join(f'{m:.0f}' for m in grown)}")
        # A raw scan that is still being written is 26 MB.
        assert max(grown) < grown[0] + 60, grown


def check_access_is_refused_and_told(browser):
    """Wrong methods, names and tokens; an open address without a token does not start."""
    with tempfile.TemporaryDirectory() as folder:
        token = Path(folder) / "token"
        made = subprocess.run([BIN / "platen", "screen", "token", token], capture_output=True, text=True, check=True).stdout
        assert oct(token.stat().st_mode & 0o777) == "0o600" and token.read_text().strip() in made
        again = subprocess.run([BIN / "platen", "screen", "token", token], capture_output=True, text=True)
        assert again.returncode == 1 and "not replaced" in again.stderr, again
        with cell() as (press, host):
            for method in ["POST", "PUT", "DELETE", "PATCH"]:
                try:
                    urllib.request.urlopen(urllib.request.Request(host.address + "/", method=method, data=b"x"))
                    raise AssertionError(method)
                except urllib.error.HTTPError as error:
                    assert error.code == 405
            try:
                urllib.request.urlopen(urllib.request.Request(host.address + "/", headers={"Host": "evil.example"}))
                raise AssertionError("Host")
            except urllib.error.HTTPError as error:
                assert error.code == 421
            wait("the log names who", lambda: "127.0.0.1" in (host.plant.parent / "host.log").read_text(), 5)
            plant = host.plant.with_name("open.toml")
            plant.write_text(host.plant.read_text().replace('listen = "127.0.0.1:0"', 'listen = "0.0.0.0:0"'))
            refused = subprocess.run([BIN / "platen", "run", plant], capture_output=True, text=True)
            assert refused.returncode == 2 and "token_file" in refused.stderr, refused
            said(refused.stderr.strip().splitlines()[-1][:160])


def check_it_stands_behind_a_proxy(_):
    """The nginx configuration of config/screen passes pages and events over TLS; Caddy and systemd take theirs."""
    files = ROOT / "config/screen"
    with cell(strokes=1, more='names = ["press3.plant.example"]\n') as (press, host), tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=press3.plant.example", "-keyout", folder / "key", "-out", folder / "pem"],
                       check=True, capture_output=True)
        (folder / "htpasswd").write_text("operator:{PLAIN}press\n")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        text = (files / "nginx.conf").read_text()
        for a, b in [("listen 443 ssl", f"listen 127.0.0.1:{port} ssl"), ("/etc/ssl/certs/press3.plant.example.pem", f"{folder}/pem"),
                     ("/etc/ssl/private/press3.plant.example.key", f"{folder}/key"), ("/etc/nginx/platen.htpasswd", f"{folder}/htpasswd"),
                     ("127.0.0.1:8380", f"127.0.0.1:{host.port}")]:
            assert a in text, a
            text = text.replace(a, b)
        (folder / "nginx.conf").write_text(f"daemon off; pid {folder}/pid; error_log {folder}/log; events {{}} http {{ access_log off; client_body_temp_path {folder}; proxy_temp_path {folder}; {text} }}")
        nginx = subprocess.Popen(["nginx", "-c", folder / "nginx.conf", "-p", folder, "-e", folder / "log"])
        try:
            def answer(path, authorization="Authorization: Basic b3BlcmF0b3I6cHJlc3M=\r\n"):
                stream = ssl._create_unverified_context().wrap_socket(socket.create_connection(("127.0.0.1", port), 5), server_hostname="press3.plant.example")
                stream.sendall(f"GET {path} HTTP/1.1\r\nHost: press3.plant.example\r\n{authorization}\r\n".encode())
                return stream
            def up():
                try:
                    return b" 200 " in answer("/").recv(200)
                except OSError:
                    return False
            wait("nginx", up, 10)
            assert b" 401 " in answer("/", "").recv(200)
            stream, text, start = answer("/live/operator"), b"", time.monotonic()
            while text.count(b"event: beat") < 3:
                text += stream.recv(65536)
            took = time.monotonic() - start
            assert b"event: state" in text
            said(f"three beats through nginx in {took:.2f} s")
        finally:
            nginx.terminate()
            nginx.wait()
    subprocess.run(["caddy", "adapt", "--config", files / "Caddyfile", "--validate"], check=True, capture_output=True)
    with tempfile.TemporaryDirectory() as folder:
        unit = Path(folder) / "platen-kiosk.service"
        unit.write_text((files / "platen-kiosk.service").read_text())
        checked = subprocess.run(["systemd-analyze", "verify", "--user", "--man=no", unit], capture_output=True, text=True)
        ours = [line for line in checked.stderr.splitlines() if "platen-kiosk" in line]
        assert not ours, ours


@contextmanager
def driver_in_a_namespace_of_its_own():
    """A browser's driver in its own network namespace; yields its two cables, each by name, our address and its address.

    The namespace and its cables last as long as the driver's processes, and those as long as this one: nothing is left on the machine
    by a test that was killed. The addresses are of 198.18.0.0/15, which RFC 2544 keeps for tests.
    """
    number = os.getpid() % 256
    cables = [(f"platen{os.getpid()}{end}", f"198.{18 + k}.{number}.1", f"198.{18 + k}.{number}.2") for k, end in enumerate("ab")]
    run = lambda *command: subprocess.run(command, check=True, capture_output=True)
    driver = subprocess.Popen(["setpriv", "--pdeathsig", "KILL", "unshare", "--net", "--pid", "--fork", "--kill-child", "--mount-proc", "sh", "-c",
                               "read _ && exec chromedriver --port=9515 --allowed-ips= '--allowed-origins=*'"],
                              stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    try:
        net = lambda pid: os.readlink(f"/proc/{pid}/ns/net")
        wait("a network namespace", lambda: net(driver.pid) != net("self"))
        inside = ["nsenter", "--net", "--target", str(driver.pid), "ip"]
        run(*inside, "link", "set", "lo", "up")
        for name, ours, its in cables:
            run("ip", "link", "add", name, "type", "veth", "peer", "name", f"{name}2", "netns", str(driver.pid))
            run("ip", "addr", "add", f"{ours}/24", "dev", name)
            run("ip", "link", "set", name, "up")
            run(*inside, "addr", "add", f"{its}/24", "dev", f"{name}2")
            run(*inside, "link", "set", f"{name}2", "up")
        driver.stdin.write(b"\n")
        driver.stdin.close()
        yield cables
    finally:
        driver.kill()
        driver.wait()


def check_a_cut_cable_leaves_no_result(_):
    """Host and browser in two network namespaces: the cable between them is cut, and put back."""
    # One cable for the page, one for the browser's driver.
    with driver_in_a_namespace_of_its_own() as [(cable, ours, _), (_, _, driver)], tempfile.TemporaryDirectory() as folder:
        token = Path(folder) / "token"
        subprocess.run([BIN / "platen", "screen", "token", token], check=True, capture_output=True)
        with cell(strokes=2, listen=ours, more=f'token_file = "{token}"\n') as (press, host):
            wait("driver", lambda: socket.socket().connect_ex((driver, 9515)) == 0, 20)
            browser = chromium(driver=f"http://{driver}:9515")
            try:
                opened(browser, host, f"/?token={token.read_text().strip()}")
                assert "token" not in browser.current_url
                link = lambda state: subprocess.run(["ip", "link", "set", cable, state], check=True)
                took = gone_after(browser, lambda: link("down"), 2.0)
                link("up")
                _, back = wait("the result is back", lambda: shown(browser)["gap"], 30)
                said(f"cable cut: gone after {took:.2f} s; put back: shown again after {back:.2f} s")
            finally:
                browser.quit()


def check_everybody_can_read_it(browser):
    """axe-core finds nothing on any page, theme and language; all is reached by keyboard; a deuteranope tells more from too far."""
    axe = Path(arguments.axe).read_text()
    with cell(strokes=3) as (press, host):
        n = 0
        for path in PAGES:
            for view in ["", "lang=ja", "theme=dark", "theme=dark&lang=ja"]:
                link = path + ("&" if "?" in path else "?") + view if view else path
                opened(browser, host, link)
                # The policy forbids injected scripts; the driver's world is apart from it.
                browser.execute_cdp_cmd("Runtime.evaluate", {"expression": axe})
                answer = browser.execute_cdp_cmd("Runtime.evaluate", {
                    "expression": "axe.run(document, {resultTypes: ['violations']}).then(r => JSON.stringify(r.violations.map(v => [v.id, v.nodes.map(n => n.html.slice(0, 120))])))",
                    "awaitPromise": True})
                found = json.loads(answer["result"]["value"])
                assert not found, f"{link}: {found}"
                n += 1
        said(f"axe-core: no violation on {n} views")
        for path in PAGES:
            opened(browser, host, path)
            name = "e => e.tagName + (e.href ?? e.textContent)"
            wanted = set(browser.execute_script(f"return [...document.querySelectorAll('a[href], button')].map({name})"))
            reached = set()
            for _ in range(len(wanted) + 60):
                browser.switch_to.active_element.send_keys(Keys.TAB)
                reached.add(browser.execute_script(f"return ({name})(document.activeElement)"))
                if wanted <= reached:
                    break
            assert wanted <= reached, (path, wanted - reached)
    colours = {"more": (0x11, 0x4c, 0x8f), "far": (0x81, 0x30, 0x00), "done": (0x16, 0x6e, 0x5a)}
    lightness = {}
    for name, (r, g, b) in colours.items():
        linear = [((c / 255 + 0.055) / 1.055) ** 2.4 if c > 10 else c / 255 / 12.92 for c in (r, g, b)]
        # Viénot, Brettel, Mollon 1999, deuteranopia.
        seen = (0.29275 * linear[0] + 0.70725 * linear[1], 0.29275 * linear[0] + 0.70725 * linear[1], -0.02234 * linear[0] + 0.02234 * linear[1] + linear[2])
        lightness[name] = [round(max(c, 0), 3) for c in seen]
    apart = sum(abs(a - b) for a, b in zip(lightness["more"], lightness["far"]))
    assert apart > 0.2, lightness
    said(f"to a deuteranope more and too far differ by {apart:.2f} in linear light; their shapes differ for everybody")


def read_from_two_metres(browser, host):
    """Returns the heights of capitals in millimetres, of the page on a full HD panel."""
    for width, height in [(1280, 800), (1920, 1080)]:
        resize(browser, width, height)
        for view in ["", "?lang=ja", "?units=in"]:
            opened(browser, host, "/" + view)
            facts = browser.execute_script("""
                const cap = id => { const e = document.getElementById(id); return parseFloat(getComputedStyle(e).fontSize) * 0.729; };
                const out = [...document.querySelectorAll('span[id], p[id], img[id], nav a')].filter(e => {
                  const r = e.getBoundingClientRect();
                  return r.width && (r.right > innerWidth + 1 || r.bottom > innerHeight + 1 || r.left < -1 || r.top < -1);
                }).map(e => e.id || e.textContent);
                const boxes = ['left', 'near', 'gap', 'gap-more', 'limit', 'place-title', 'advice', 'remark', 'advised-before', 'bar-gap', 'strip-0'].map(id => document.getElementById(id).getBoundingClientRect());
                const foot = document.querySelector('footer').getBoundingClientRect();
                return {caps: Object.fromEntries(['verdict', 'left', 'near', 'gap', 'left-words', 'limit', 'stroke', 'press'].map(id => [id, cap(id)])), out,
                        below: boxes.filter(b => b.bottom > foot.top + 1).length,
                        scrolls: document.documentElement.scrollHeight > innerHeight || document.documentElement.scrollWidth > innerWidth};""")
            assert not facts["scrolls"] and not facts["out"] and not facts["below"], (width, view, facts)
            scale = height / 136
            caps = {name: cap / scale for name, cap in facts["caps"].items()}
            for name, least in [("verdict", 12), ("left", 12), ("near", 12), ("gap", 12), ("left-words", 5), ("limit", 4.5), ("stroke", 5)]:
                assert caps[name] >= least - 0.1, (name, caps)
    resize(browser, 1280, 800)
    return caps


def check_it_is_read_from_two_metres(browser):
    """Heights of capitals on a 10-inch panel, no scrolling, nothing cut off."""
    with cell(strokes=3) as (_, measured), advised() as advised_host:
        for host in [measured, advised_host]:
            caps = read_from_two_metres(browser, host)
            said("capitals in mm: " + ", ".join(f"{name} {cap:.1f}" for name, cap in caps.items()))


def compared(browser, name):
    """Holds a screenshot against the golden one: at most 0.5 % of the pixels differ by more than 16 of 255."""
    settled(browser)
    picture = Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB")
    path = GOLDEN / f"{name}.png"
    if arguments.bless:
        GOLDEN.mkdir(parents=True, exist_ok=True)
        picture.quantize(64, dither=Image.Dither.NONE).save(path, optimize=True)
    if arguments.out:
        Path(arguments.out).mkdir(parents=True, exist_ok=True)
        picture.save(Path(arguments.out) / f"{name}.png")
    golden = Image.open(path).convert("RGB")
    assert golden.size == picture.size, (name, golden.size, picture.size)
    histogram = ImageChops.difference(golden, picture).convert("L").histogram()
    share = sum(histogram[17:]) / sum(histogram)
    assert share <= 0.005, f"{name}: {100 * share:.2f} % of the pixels differ"
    return share


def advice_of(host, run):
    """Waits for the advice after a stroke, and returns it."""
    def advice():
        result = host.state()["result"]
        return result and result["run"] == run and result["advice"]
    return wait(f"advice after stroke {run}", advice, 60)[0]


@contextmanager
def advised():
    """A host whose page shows the advice for the third stroke."""
    with cell(ram=True, more=ADVICE) as (press, host):
        for run in [1, 2]:
            bend = advice_of(host, run)["bend"]
            order = {"axis_deg": 90, "at_mm": sum(end[0] for end in bend["line_mm"]) / 2 - 1500, "depth_mm": bend["depth_mm"]}
            wait("an order taken", lambda: press.ask({"do": {"order": order}}).get("ok"), 30)
        advice_of(host, 3)
        yield host


def check_the_pictures_are_those_that_a_person_has_seen(browser):
    """Golden screenshots: sizes, languages, units, themes, stale, alarm, advice."""
    worst = 0
    with advised() as host:
        for name, view in [("advice", ""), ("advice-ja", "?lang=ja&theme=dark")]:
            opened(browser, host, "/" + view)
            worst = max(worst, compared(browser, f"operator-{name}"))
    with cell(strokes=4) as (press, host):
        again = heading(host) == "PRESS HERE AGAIN"
        wait("again, where it is", lambda: host.state()["result"]["again"] == again)
        for name, size, view in [("en", (1280, 800), ""), ("ja", (1280, 800), "?lang=ja"), ("inch", (1280, 800), "?units=in"),
                                 ("dark", (1280, 800), "?theme=dark"), ("large", (1920, 1080), ""), ("large-ja-dark", (1920, 1080), "?lang=ja&theme=dark"),
                                 ("drawing", (1280, 800), "?turn=drawing")]:
            resize(browser, *size)
            opened(browser, host, "/" + view)
            worst = max(worst, compared(browser, f"operator-{name}"))
        resize(browser, 1280, 800)
        opened(browser, host)
        press.ask({"do": {"halt_ms": 60000}})
        wait("an alarm", lambda: "103" in shown(browser)["alarm"], 30)
        worst = max(worst, compared(browser, "operator-alarm"))
        host.process.send_signal(signal.SIGSTOP)
        wait("stale", lambda: nothing_is_left(browser), 10)
        worst = max(worst, compared(browser, "operator-stale"))
        host.process.send_signal(signal.SIGCONT)
    said(f"at most {100 * worst:.2f} % of the pixels differ")


def check_the_plate_is_drawn(browser):
    """WebGL draws the plate; without it the map is shown."""
    with cell(strokes=3) as (press, host):
        browser.get(host.address + "/plate?run=2")
        wait("triangles", lambda: browser.execute_script("return document.getElementById('plate').dataset.drawn"), 20)
        drawn = int(browser.execute_script("return document.getElementById('plate').dataset.drawn"))
        assert drawn > 15_000, drawn
        said(f"{drawn} triangles")
        browser.execute_cdp_cmd("Page.enable", {})
        script = browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": "HTMLCanvasElement.prototype.getContext = () => null"})
        browser.get(host.address + "/plate?run=2")
        wait("the map", lambda: browser.execute_script("return !document.getElementById('flat').hidden"), 10)
        browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", script)


def check_a_week_needs_no_reload(browser):
    """10,000 updates leave the page's memory as it was; everything comes from the host."""
    with cell(strokes=2) as (press, host):
        opened(browser, host)
        heap = lambda: (browser.execute_cdp_cmd("HeapProfiler.collectGarbage", {}),
                        browser.execute_cdp_cmd("Runtime.getHeapUsage", {})["usedSize"])[1]
        # The page's own handler, fed with its own last state: two that differ, in turn.
        browser.execute_cdp_cmd("Page.enable", {})
        keep = browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": """
            const Own = EventSource;
            window.EventSource = class extends Own { constructor(...a) { super(...a); window.stream = this; this.addEventListener('state', e => { window.last ??= e.data; }); } };"""})
        opened(browser, host)
        wait("a state", lambda: browser.execute_script("return window.last !== undefined"), 10)
        feed = """
            const states = [window.last, window.last.replaceAll('"class":"band more"', '"class":"band unknown"').replace(/"text":"[^"]*"/g, '"text":"changed"')];
            for (let k = 0; k < arguments[0]; k++) window.stream.dispatchEvent(new MessageEvent('state', {data: states[k % 2]}));"""
        browser.execute_script(feed, 500)
        before = heap()
        browser.execute_script(feed, 10000)
        after = heap()
        said(f"heap {before / 1e6:.2f} -> {after / 1e6:.2f} MB after 10,000 updates")
        assert after < 1.1 * before
        browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", keep)
        foreign = browser.execute_script("return performance.getEntriesByType('resource').map(e => e.name).filter(n => !n.startsWith(arguments[0]))", host.address)
        assert not foreign, foreign
        weight = browser.execute_script("return performance.getEntriesByType('resource').filter(e => e.initiatorType !== 'other').reduce((s, e) => s + e.encodedBodySize, 0)")
        paint = browser.execute_script("return performance.getEntriesByName('first-contentful-paint')[0]?.startTime")
        said(f"everything of the operator's page: {weight / 1000:.1f} kB packed; first paint after {paint:.0f} ms")
        assert weight < 60_000


def main():
    global arguments
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--axe", default=str(ROOT / "target/axe/package/axe.min.js"), help="axe.min.js of axe-core")
    parser.add_argument("--out", help="folder for the screenshots of this run")
    parser.add_argument("--bless", action="store_true")
    parser.add_argument("--only", default="")
    parser.add_argument("--strokes", type=int, default=8)
    parser.add_argument("--turns", type=int, default=3, help="turns with readers, and as many without")
    parser.add_argument("--reads", type=int, default=1000, help="how often every page is opened beside the registers")
    arguments = parser.parse_args()
    checks = [(name[6:].replace("_", " "), check) for name, check in globals().items() if name.startswith("check_")]
    browser = chromium()
    try:
        for name, check in checks:
            if arguments.only in name:
                print(name, flush=True)
                check(browser)
    finally:
        browser.quit()


if __name__ == "__main__":
    sys.exit(main())
