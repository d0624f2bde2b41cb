"""Debian's PostgreSQL and mosquitto with TLS, presses with hosts and forwarders, each in a folder of its own, on free ports of loopback."""
import json, os, shutil, signal, socket, sqlite3, subprocess, time
from pathlib import Path

import psycopg

ROOT = Path(__file__).resolve().parents[3]
BIN = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"
PLATEN = BIN / "platen"
POSTGRESQL = sorted(Path("/usr/lib/postgresql").glob("*/bin"))[-1]
OWNER = "platen_owner"


def wait(what, check, limit=30.0, every=0.02):
    """Waits until `check` returns something true, and returns it."""
    end = time.monotonic() + limit
    while time.monotonic() < end:
        found = check()
        if found:
            return found
        time.sleep(every)
    raise AssertionError(f"not within {limit} s: {what}")


def reserved_port():
    """A socket bound to a free port of loopback. While it is held no connection gets that port as its own, and a server can take it, again and again."""
    held = socket.socket()
    held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    held.bind(("127.0.0.1", 0))
    return held, held.getsockname()[1]


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def run(*arguments, code=0, timeout=120, **more):
    """Runs the program; returns its output, and its error line where it fails as it must."""
    done = subprocess.run([PLATEN, *map(str, arguments)], capture_output=True, text=True, timeout=timeout, **more)
    assert done.returncode == code, f"{arguments}: exit code {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout if code == 0 else done.stderr


class Authority:
    """A certificate authority, and the certificates that it signs for localhost."""

    def __init__(self, folder):
        self.folder, self.file = folder, folder / "ca.pem"
        self.openssl("req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "30", "-subj", "/CN=test authority", "-keyout", "ca.key", "-out",
                     "ca.pem", "-addext", "basicConstraints=critical,CA:TRUE")

    def openssl(self, *arguments):
        subprocess.run(["openssl", *arguments], cwd=self.folder, check=True, capture_output=True)

    def sign(self, name, dates=()):
        """Makes NAME.pem and NAME.key; `dates` are openssl's -not_before and -not_after."""
        self.openssl("req", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost", "-keyout", f"{name}.key", "-out", f"{name}.csr")
        (self.folder / "names").write_text("subjectAltName=DNS:localhost,IP:127.0.0.1")
        if dates:
            for file, text in [("index.txt", ""), ("serial", "01\n")]:
                (self.folder / file).write_text(text)
            (self.folder / "ca.conf").write_text(
                "[ca]\ndefault_ca=c\n[c]\ndatabase=index.txt\nserial=serial\nnew_certs_dir=.\ndefault_md=sha256\npolicy=p\n[p]\ncommonName=supplied\n")
            self.openssl("ca", "-batch", "-config", "ca.conf", "-cert", "ca.pem", "-keyfile", "ca.key", "-in", f"{name}.csr", "-out", f"{name}.pem",
                         "-notext", "-extfile", "names", "-startdate", dates[0], "-enddate", dates[1])
        else:
            self.openssl("x509", "-req", "-in", f"{name}.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial", "-days", "30", "-out",
                         f"{name}.pem", "-extfile", "names")
        return self.folder / f"{name}.pem", self.folder / f"{name}.key"


class Postgresql:
    """A PostgreSQL server; `folder` may lie on a small disk. Without `settings` it has PostgreSQL's own."""

    def __init__(self, authority, folder, settings="shared_buffers=64MB\nmax_wal_size=64MB\nmin_wal_size=32MB\n"):
        self.held, self.port = reserved_port()
        self.folder, self.data, self.process = folder, folder / "data", None
        folder.mkdir(exist_ok=True)
        shutil.chown(folder, "postgres")
        (folder / "password").write_text("owner\n")
        made = self.as_postgres("initdb", "-D", self.data, "-A", "scram-sha-256", "-U", OWNER, f"--pwfile={folder / 'password'}", "--no-sync").wait()
        assert made == 0, self.log()
        certificate, key = authority.sign("postgresql")
        for file, name in [(certificate, "server.pem"), (key, "server.key")]:
            shutil.copy(file, self.data / name)
            shutil.chown(self.data / name, "postgres")
            os.chmod(self.data / name, 0o600)
        with open(self.data / "postgresql.conf", "a") as file:
            file.write(f"port={self.port}\nlisten_addresses='127.0.0.1'\nunix_socket_directories='{folder}'\nssl=on\n"
                       f"ssl_cert_file='server.pem'\nssl_key_file='server.key'\n{settings}")
        self.start()
        with self.connect("postgres") as database:
            database.execute("CREATE DATABASE platen")

    def as_postgres(self, program, *arguments):
        return subprocess.Popen([POSTGRESQL / program, *arguments], user="postgres", group="postgres", extra_groups=[], cwd="/",
                                stdout=open(self.folder / "log", "a"), stderr=subprocess.STDOUT)

    def log(self):
        return "PostgreSQL's log ends with:\n" + "".join((self.folder / "log").read_text().splitlines(True)[-10:])

    def start(self):
        """Starts it as a child of this program, which alone can say that a killed server has ended; its process id in the lock file is free then."""
        self.process = self.as_postgres("postgres", "-D", self.data)

        def answers():
            assert self.process.poll() is None, self.log()
            return subprocess.run([POSTGRESQL / "pg_isready", "-q", "-h", "127.0.0.1", "-p", str(self.port)]).returncode == 0
        wait("PostgreSQL", answers, 60)

    def stop(self, how=signal.SIGINT):
        """SIGINT: its fast shutdown; SIGQUIT: the immediate one."""
        self.process.send_signal(how)
        self.process.wait(60)

    def kill(self):
        """Kills it and its children, and waits for their end: an orphan holds the shared memory, and the next server does not start."""
        self.process.send_signal(signal.SIGSTOP)
        children = subprocess.run(["pgrep", "-P", str(self.process.pid)], capture_output=True, text=True).stdout.split()
        for pid in [self.process.pid, *map(int, children)]:
            os.kill(pid, signal.SIGKILL)
        self.process.wait()
        wait("the end of its children", lambda: not any(map(is_running, children)))

    def connect(self, name="platen"):
        return psycopg.connect(host="127.0.0.1", port=self.port, dbname=name, user=OWNER, password="owner", autocommit=True)

    def query(self, sql, *values):
        with self.connect() as database:
            return database.execute(sql, values or None).fetchall()

    def admit(self, site, press):
        with self.connect() as database:
            database.execute(f"""CREATE ROLE "{site}/{press}" LOGIN PASSWORD 'secret' IN ROLE platen_writer""")


class Mosquitto:
    """A mosquitto broker on TLS with a password and a list of access for each press."""

    def __init__(self, authority, folder, certificate=None):
        self.held, self.port = reserved_port()
        self.folder, self.process = folder, None
        folder.mkdir(exist_ok=True)
        pem, key = certificate or authority.sign("mosquitto")
        (folder / "conf").write_text(
            f"user root\nlistener {self.port} 127.0.0.1\ncafile {authority.file}\ncertfile {pem}\nkeyfile {key}\npassword_file {folder / 'passwords'}\n"
            f"acl_file {folder / 'access'}\nallow_anonymous false\nmax_queued_messages 0\n"
            f"persistence true\npersistence_location {folder}/\nautosave_on_changes true\nautosave_interval 1\n")
        self.admit_all([])

    def admit_all(self, presses):
        """Starts anew with these users, and `reader`, who reads everything and commands Sparkplug nodes."""
        self.stop()
        passwords = self.folder / "passwords"
        passwords.write_text("")
        access = ["user reader", "topic read #", "topic readwrite spBv1.0/#"]
        for user in [*presses, "reader"]:
            subprocess.run(["mosquitto_passwd", "-b", passwords, user, "secret"], check=True)
        for user in presses:
            site, press = user.split("/")
            access += [f"user {user}", f"topic write platen/v1/{user}/#", f"topic write spBv1.0/{site}/+/{press}", f"topic write spBv1.0/{site}/+/{press}/#",
                       f"topic read spBv1.0/{site}/NCMD/{press}", "topic read spBv1.0/STATE/#"]
        (self.folder / "access").write_text("\n".join(access) + "\n")
        self.start()

    def start(self):
        self.process = subprocess.Popen(["mosquitto", "-c", self.folder / "conf"], stdout=open(self.folder / "log", "a"), stderr=subprocess.STDOUT)

        def answers():
            with socket.socket() as probe:
                return probe.connect_ex(("127.0.0.1", self.port)) == 0
        wait("mosquitto", answers)

    def stop(self, how=signal.SIGTERM):
        if self.process:
            self.process.send_signal(how)
            self.process.wait()
            self.process = None


class Plant:
    """A press with its host and forwarder. `sinks` are lines of TOML."""

    def __init__(self, folder, name, sinks, site="kure", strokes=0, parts=1, between_ms=10, step_deg=0.12):
        self.folder, self.name, self.site = folder, name, site
        folder.mkdir()
        self.user, self.step_deg = f"{site}/{name}", step_deg
        (folder / "password").write_text("secret\n")
        (folder / "press.toml").write_text(
            f"press_id = 3\nrecipe_id = 9\npart_name = \"{name}\"\nautomatic = {str(strokes > 0).lower()}\nstrokes = {max(strokes, 14)}\nparts = {parts}\nbaseline = false\n"
            f"[timings]\ndown_ms = 20\nup_ms = 20\nbetween_ms = {between_ms}\nhost_ms = 60000\n"
            f"[plate.plan]\nstrokes_per_pass = {max(strokes, 14)}\npasses = 1\n"
            "[plate]\ntarget = { shape = \"cylinder\", radius_mm = 9018.0, axis_deg = 90.0 }\n"
            "[plate.blank]\nwidth_mm = 3000.0\nheight_mm = 2500.0\nthickness_mm = 36.0\n")
        self.plant = folder / "plant.toml"
        self.sinks, self.press, self.host, self.forwarder, self.modbus = sinks, None, None, None, ("127.0.0.1:1", "127.0.0.1:1")
        self.write()

    def write(self):
        modbus, plate = self.modbus
        forward = f'[forward]\nsite = "{self.site}"\npress = "{self.name}"\n{self.sinks}' if self.sinks else ""
        self.plant.write_text(
            f'[plant]\nname = "{self.name}"\n[press]\nname = "{self.name}"\npress_id = 3\n[press.link]\ntype = "tcp"\nhost = "127.0.0.1"\n'
            f'port = {modbus.rsplit(":", 1)[1]}\nunit = 1\n[scanner]\nplugin = "simulated"\n[scanner.options]\nstep_deg = {self.step_deg}\ncell = "{plate}"\n'
            f'[frame]\nu_axis = [1.0, 0.0, 0.0]\n[plates]\nfolder = "{ROOT / "config/plates"}"\n[flattening]\nplugin = "harmonic"\n'
            f'[[comparison]]\nplugin = "template"\n[output]\nfolder = "results"\nkeep_scans = 0\n{forward}')

    def start_press(self):
        self.press = subprocess.Popen([BIN / "platen-sim", "press", self.folder / "press.toml", "--with-parent"], stdin=subprocess.PIPE,
                                      stdout=subprocess.PIPE)
        ports = json.loads(self.press.stdout.readline())
        self.modbus = ports["modbus"], ports["plate"]
        host, port = ports["plate"].rsplit(":", 1)
        self.control = socket.create_connection((host, int(port))).makefile("rw")
        self.write()

    def ask(self, line):
        self.control.write(json.dumps(line) + "\n")
        self.control.flush()
        return json.loads(self.control.readline())

    def stroke(self):
        before = self.ask({"get": "counts"})["counts"]["results"]
        assert self.ask({"do": "stroke"}).get("ok")
        wait("the result of a stroke", lambda: self.ask({"get": "counts"})["counts"]["results"] > before, 60)
        wait("its acknowledgement on record", lambda: not self.database().execute("SELECT count(*) FROM stroke WHERE acked IS NULL").fetchone()[0])

    def start_host(self):
        self.host = subprocess.Popen([PLATEN, "run", self.plant], stdout=subprocess.DEVNULL, stderr=open(self.folder / "host.log", "a"))
        wait("the host", lambda: (self.folder / "results/history.sqlite").exists())

    def start_forwarder(self, *arguments):
        as_the_unit = ["chrt", "--idle", "0", "ionice", "-c", "3"]
        self.forwarder = subprocess.Popen([*as_the_unit, PLATEN, "forward", self.plant, *arguments], stdout=subprocess.DEVNULL, stderr=open(self.folder / "forward.log", "a"))

    def end(self, what, how=signal.SIGTERM):
        process = getattr(self, what)
        if process and process.poll() is None:
            process.send_signal(how)
        if process:
            process.wait(60)
        setattr(self, what, None)

    def end_all(self):
        for what in ["forwarder", "host", "press"]:
            self.end(what, signal.SIGKILL if what == "press" else signal.SIGTERM)

    def status(self):
        """What `platen status` prints, whether or not the host runs."""
        return subprocess.run([PLATEN, "status", self.plant], capture_output=True, text=True, timeout=30).stdout

    def flush(self):
        """Sends what is not sent yet."""
        return json.loads(run("forward", self.plant, "--until-sent", "--json"))["sinks"]

    def strokes(self):
        return json.loads(run("history", "list", self.plant, "--newest", "1000000", "--json"))

    def database(self):
        return sqlite3.connect(self.folder / "results/history.sqlite", timeout=30)

    def log(self):
        return (self.folder / "forward.log").read_text()


def multiply(plant, count, days=1.0):
    """Repeats the last stroke of a record `count` times over a time of `days` before now, as quick as SQLite writes."""
    with plant.database() as database:
        columns = [row[1] for row in database.execute("PRAGMA table_info(stroke)")]
        last = database.execute("SELECT max(run_id) FROM stroke").fetchone()[0]
        kept = [c for c in columns if c not in ("run_id", "stroke", "session", "accepted", "scanned", "finished", "acked", "verdict")]
        at = "strftime('%Y-%m-%dT%H:%M:%fZ', 'now', printf('-%f seconds', (:n - :k) * :days * 86400.0 / :n))"
        insert = (f"INSERT INTO stroke (run_id, session, stroke, accepted, {', '.join(kept)}) "
                  f"SELECT run_id + :k, 1 + (run_id + :k) / 60000, (run_id + :k) % 60000, {at}, {', '.join(kept)} FROM stroke WHERE run_id = :last")
        finish = f"UPDATE stroke SET scanned = {at}, finished = {at}, verdict = 'fail' WHERE run_id = :last + :k"
        acked = f"UPDATE stroke SET acked = {at} WHERE run_id = :last + :k"
        for k in range(1, count + 1):
            values = {"k": k, "n": count, "days": days, "last": last}
            for sql in (insert, finish, acked):
                database.execute(sql, values)
