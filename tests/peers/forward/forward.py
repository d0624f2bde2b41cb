"""`platen forward` against Debian's PostgreSQL and mosquitto: nothing lost, nothing twice, whatever is stopped, killed, full or lied about.

Runs the release build's programs as child processes. Every check prints one line; the first that fails ends the program with exit code 1.
As root: the servers run as their own users. `--only WORD` runs some checks, `--strokes N` sets how many each of five presses makes.
"""
import argparse, json, os, random, re, signal, socket, subprocess, sys, tempfile, threading, time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jsonschema
import paho.mqtt.client as paho

import dashboards
from servers import OWNER, ROOT, Authority, Mosquitto, Plant, Postgresql, multiply, run, wait

arguments = None
SITE = "kure"


def said(text):
    print(f"  {text}", flush=True)


class Site:
    """The servers of a check, the presses' sinks, and a reader that takes everything from the broker. `servers`: their folder, where they have another disk."""

    def __init__(self, folder, servers=None):
        self.folder, servers = Path(folder), Path(servers or folder)
        os.chmod(folder, 0o755)
        self.authority = Authority(self.folder)
        self.presses, self.reader, self.received = [], None, []
        self.postgresql = Postgresql(self.authority, servers / "postgresql")
        self.mosquitto = Mosquitto(self.authority, servers / "mosquitto")

    def sinks(self, *kinds, more=""):
        port = {"postgresql": self.postgresql.port, "mqtt": self.mosquitto.port, "sparkplug": self.mosquitto.port}
        return "".join(f'[[forward.sink]]\ntype = "{kind}"\nhost = "localhost"\nport = {port[kind]}\nca_file = "{self.authority.file}"\n'
                       f'password_file = "password"\n{more if kind == "sparkplug" else ""}' for kind in kinds)

    def press(self, name, *kinds, strokes=0, more="", sinks=None, **press):
        plant = Plant(self.folder / f"plant-{len(self.presses)}", name, self.sinks(*kinds, more=more) if sinks is None else sinks, SITE, strokes, **press)
        self.presses.append(plant)
        return plant

    def prepare(self):
        """Makes the tables by the program, and a role and a user for each press."""
        password = self.folder / "owner"
        password.write_text("owner\n")
        if "postgresql" in self.presses[-1].sinks:
            run("forward", "schema", "--apply", self.presses[-1].plant, "--user", OWNER, "--password-file", password)
            for name in sorted({plant.name for plant in self.presses}):
                self.postgresql.admit(SITE, name)
        self.mosquitto.admit_all(sorted({plant.user for plant in self.presses}))

    def read(self, topic="#"):
        """Takes what the broker has, from now on, whatever happens to the connection."""
        # Its session outlives the connection and the broker.
        client = paho.Client(client_id="reader", clean_session=False)
        client.username_pw_set("reader", "secret")
        client.tls_set(str(self.authority.file))
        client.reconnect_delay_set(0.05, 0.2)
        joined = threading.Event()
        client.on_connect = lambda client, *_: client.subscribe([(topic, 1), ("spBv1.0/#", 1)])
        client.on_subscribe = lambda *_: joined.set()
        client.on_message = lambda client, _, message: self.received.append((message.topic, message.payload, message.retain))
        client.connect("localhost", self.mosquitto.port)
        self.reader = client

        def listen():
            # The library's own thread ends with an error of TLS in mid-connection.
            while self.reader:
                try:
                    client.loop_forever(retry_first_connection=True)
                except OSError:
                    time.sleep(0.05)
                    try:
                        client.reconnect()
                    except OSError:
                        pass
        threading.Thread(target=listen, daemon=True).start()
        assert joined.wait(10)

    def keys(self):
        """Keys of the messages received, in their order."""
        documents = [json.loads(payload) for topic, payload, _ in self.received if topic.endswith(("/stroke", "/alarm"))]
        return [(it["press"], it["owner"], it["kind"], it["id"]) for it in documents]

    def end(self):
        for plant in self.presses:
            plant.end_all()
        if self.reader:
            reader, self.reader = self.reader, None
            reader.disconnect()
        self.mosquitto.stop()
        self.postgresql.stop(signal.SIGQUIT)


def one_stroke(site, *kinds, name="press-1"):
    """A press with one stroke on record and sinks; nothing is sent yet."""
    plant = site.press(name, *kinds)
    site.prepare()
    plant.start_press()
    plant.start_host()
    plant.stroke()
    plant.end("host")
    return plant


def latency(plant):
    return json.loads(run("status", plant.plant, "--json"))["status"]["trigger_to_busy_ms"]


def check_every_stroke_arrives_exactly_once(site):
    """Five hosts; both servers stopped, started and killed, forwarders killed 20 times: every stroke exactly once, and in order at the broker."""
    strokes, names = arguments.strokes, [f"press-{k}" for k in range(5)]
    plants = [site.press(name, "postgresql", "mqtt", strokes=strokes) for name in names]
    site.prepare()
    site.read()
    chance = random.Random(arguments.seed)
    for plant in plants:
        plant.start_press()
        plant.start_host()
        plant.start_forwarder()
    done = lambda: all(plant.ask({"get": "stats"})["stats"]["done"] for plant in plants)
    kills, outages = 0, ["postgresql stopped", "mosquitto stopped", "postgresql killed", "mosquitto killed"]
    made = lambda: sum(plant.ask({"get": "counts"})["counts"]["results"] for plant in plants)
    total, busy = strokes * len(plants), []
    while not done():
        if kills < arguments.kills and made() >= total * kills / arguments.kills:
            plant = chance.choice(plants)
            plant.end("forwarder", signal.SIGKILL)
            plant.start_forwarder()
            kills += 1
        if outages and made() >= total * (5 - len(outages)) / 6:
            what = outages.pop(0)
            server = site.postgresql if what.startswith("postgresql") else site.mosquitto
            if server is site.mosquitto:
                server.stop(signal.SIGKILL if "killed" in what else signal.SIGTERM)
            else:
                server.kill() if "killed" in what else server.stop()
            wait("strokes while it is away", lambda now=made(): done() or made() > now + 5, 120)
            server.start()
        time.sleep(0.05)
    assert kills == arguments.kills and not outages, (kills, outages)
    for plant in plants:
        busy.append(latency(plant)[1])
        plant.end("forwarder")
        sinks = plant.flush()
        assert all(it["backlog"] == 0 and it["conflicts"] == 0 and it["refused"] == 0 for it in sinks), sinks
    wait("the last message", lambda: len(set(site.keys())) >= 3 * total)
    for plant in plants:
        wanted = {it["run_id"]: (it["verdict"], it["figures"].get("gap.max")) for it in plant.strokes()}
        rows = site.postgresql.query("SELECT run_id, verdict, gap_max_mm / 1000, acked IS NOT NULL FROM platen.stroke WHERE press = %s", plant.name)
        assert len(rows) == len(wanted) >= strokes, (len(rows), len(wanted))
        for run_id, verdict, gap, acked in rows:
            assert (verdict, acked) == (wanted[run_id][0], True) and abs((gap or 0) - (wanted[run_id][1] or 0)) < 1e-12, run_id
    keys = site.keys()
    first = list(dict.fromkeys(keys))
    for name in names:
        ids = [key for key in first if key[0] == name and key[2] == "finished"]
        assert ids == sorted(ids, key=lambda key: key[3]), "in the order of the record"
    assert site.postgresql.query("SELECT count(*) FROM platen.aside") == [(0,)]
    said(f"{total} strokes, {len(keys)} messages of {len(first)} changes at the broker, {kills} forwarders killed, both servers stopped and killed; "
         f"trigger to busy, 99 %: {max(busy):.0f} ms")


def check_the_press_side_is_not_moved(site):
    """The same press without sinks, with sinks, and with sinks that are stopped in mid-connection: its times beside each other."""
    times = {}
    for what in ["without sinks", "with sinks", "with sinks that hang"]:
        plant = site.press(f"press-{len(times)}", *(["postgresql", "mqtt"] if times else []), strokes=30, sinks=None if times else "")
        if len(times) == 1:
            site.prepare()
        elif times:
            site.postgresql.admit(SITE, plant.name)
            site.mosquitto.admit_all([it.user for it in site.presses])
        plant.start_press()
        if times:
            plant.start_host()
            plant.start_forwarder()
            if "hang" in what:
                pids = [site.mosquitto.process.pid, *map(int, subprocess.run(["pgrep", "-u", "postgres"], capture_output=True, text=True).stdout.split())]
                wait("a stroke", lambda: plant.ask({"get": "counts"})["counts"]["results"] > 2, 60)
                for pid in pids:
                    os.kill(pid, signal.SIGSTOP)
        else:
            plant.start_host()
        wait("all strokes", lambda: plant.ask({"get": "stats"})["stats"]["done"], 240)
        times[what] = latency(plant)
        if "hang" in what:
            line = plant.status()
            for pid in pids:
                os.kill(pid, signal.SIGCONT)
            assert "no answer in 5 s" in line, line
            said(next(it for it in line.splitlines() if it.startswith("sink mqtt")))
        plant.end_all()
    said("trigger to busy, median and 99 %: " + "; ".join(f"{what} {a:.0f}, {b:.0f} ms" for what, (a, b) in times.items()))


def check_messages_are_of_the_schema(site):
    """Every kind of message against core/forward/schema."""
    schema = jsonschema.Draft202012Validator(json.loads((ROOT / "core/forward/schema/platen.stroke-1.json").read_text()))
    plant = one_stroke(site, "mqtt")
    with plant.database() as database:
        database.execute("INSERT INTO event (at, kind, text) VALUES ('2026-11-24T10:00:00.000Z', 'alarm', '102 the link broke')")
        database.execute("UPDATE plate SET ended = '2026-11-24T10:00:00.000Z'")
        database.execute("UPDATE stroke SET data = json_set(data, '$.part_name', 'a' || char(0) || 'b', '$.crew', 7)")
    site.read()
    plant.flush()
    documents = wait("five messages", lambda: (found := [json.loads(it) for topic, it, _ in site.received if topic.endswith(("stroke", "alarm"))])[4:] and found)
    for document in documents:
        faults = list(schema.iter_errors(document))
        assert not faults, faults[0]
        assert "crew" not in json.dumps(document), "codes of crews stay in the record"
    kinds = sorted(it["kind"] for it in documents)
    assert kinds == ["accepted", "acked", "event", "finished", "plate"], kinds
    said(f"{', '.join(kinds)}; the longest has {max(len(it) for _, it, _ in site.received)} bytes")


def check_a_backlog_drains_in_order(site):
    """A day of strokes behind: the newest state first, then every change in order; status counts down."""
    plant = one_stroke(site, "postgresql", "mqtt")
    multiply(plant, 3000)
    site.read()
    start = time.monotonic()
    plant.start_forwarder()
    backlogs = []

    def counted():
        sinks = json.loads((plant.folder / "results/forward.json").read_text())["sinks"] if (plant.folder / "results/forward.json").exists() else []
        backlogs.append(max((it["backlog"] for it in sinks), default=0))
        return sinks and all(it["backlog"] == 0 and it["connected"] for it in sinks)
    wait("the end of the backlog", counted, 120)
    took = time.monotonic() - start
    wait("the last message", lambda: len(site.keys()) >= 9003)
    ids = [key[3] for key in site.keys() if key[2] == "finished"]
    assert ids == list(range(1, 3002)), "in order"
    assert site.received[0][0].endswith("/state"), site.received[0][0]
    assert max(backlogs) > 3000 and backlogs[-1] == 0
    assert site.postgresql.query("SELECT count(*), count(acked) FROM platen.stroke") == [(3001, 3001)]
    said(f"9,003 changes to both sinks in {took:.1f} s: {9003 / took:.0f} a second; largest backlog told {max(backlogs)}")


def check_a_restored_record_goes_on(site):
    """Backup, two strokes that are lost with the machine, restore, two other strokes: they arrive as new, none overwrites, also without cursors."""
    plant = one_stroke(site, "postgresql")
    plant.flush()
    run("history", "backup", plant.plant, plant.folder / "backup")
    plant.start_host()
    for _ in range(2):
        plant.stroke()
    plant.end("host")
    plant.flush()
    lost = site.postgresql.query("SELECT owner, run_id, accepted FROM platen.stroke ORDER BY 1, 2")
    cursors = (plant.folder / "results/forward.sqlite").read_bytes()
    subprocess.run(["rm", "-r", plant.folder / "results"], check=True)
    owners = json.loads(run("history", "restore", plant.folder / "backup", plant.plant, "--json"))["owners"]
    (plant.folder / "results/forward.sqlite").write_bytes(cursors)
    plant.start_host()
    for _ in range(2):
        plant.stroke()
    plant.end("host")
    plant.flush()
    now = site.postgresql.query("SELECT owner, run_id, accepted FROM platen.stroke ORDER BY accepted")
    assert len(now) == 5 and set(lost) < set(now), now
    assert [(owner, run_id) for owner, run_id, _ in now[3:]] == [(owners[0][1], 2), (owners[0][1], 3)], (now, owners)
    (plant.folder / "results/forward.sqlite").unlink()
    sinks = plant.flush()
    assert sinks[0]["sent"] >= 9 and sinks[0]["conflicts"] == 0
    assert site.postgresql.query("SELECT count(*) FROM platen.stroke") == [(5,)], "sent again, and nothing changed"
    said(f"owner {owners[0][0]} became {owners[0][1]}; 3 strokes before, 2 new ones under run ids 2 and 3; all sent again without cursors: 5 strokes")


def check_two_presses_of_one_name_are_kept_apart(site):
    """The second is kept apart by the database; both say so in status and by an alarm; the broker takes turns and says so, too."""
    first, second = (site.press("press-1", "postgresql", "mqtt") for _ in range(2))
    site.prepare()
    for plant in (first, second):
        plant.start_press()
        plant.start_host()
        plant.start_forwarder()
        plant.stroke()
        # The name is whose changes arrive first: the second begins when the first has it.
        wait("the first to have the name", lambda: site.postgresql.query("SELECT count(acked) FROM platen.stroke") == [(1,)])
    wait("kept apart", lambda: site.postgresql.query("SELECT count(*) FROM platen.aside WHERE why = 'apart'") >= [(3,)])
    first.stroke()
    for plant in (first, second):
        line = wait("a sentence", lambda: (m := re.search(r"sink postgresql: (.*record.*)", plant.status())) and m[1])
        wait("an alarm", lambda: "newest alarm" in (text := plant.status()) and "411" in text)
        said(line)
    wait("the broker's word", lambda: all("client has this press's name" in plant.log() for plant in (first, second)))
    for plant in (first, second):
        plant.end("forwarder")
        plant.end("host")
    assert {it[0] for it in site.postgresql.query("SELECT count(*) FROM platen.stroke")} == {2}
    writer = site.postgresql.query("SELECT writer FROM platen.aside LIMIT 1")[0][0]
    came = site.postgresql.query("SELECT platen.accept(%s, 'press-1', %s)", SITE, writer)[0][0]
    said(f"accept: {came} changes came in; strokes now {site.postgresql.query('SELECT count(*) FROM platen.stroke')[0][0]}")
    assert came >= 3 and site.postgresql.query("SELECT count(*) FROM platen.stroke") == [(3,)]


def check_a_migration_while_hosts_write(site):
    """The first files applied, hosts write, the rest and a later one applied while they do: nobody is restarted, nothing is lost."""
    plants = [site.press(f"press-{k}", "postgresql") for k in range(2)]
    files = sorted((ROOT / "core/forward/sql").glob("*.sql"))
    noted = lambda k: f"INSERT INTO platen.migration (number, name) VALUES ({k}, 'by hand')"
    with site.postgresql.connect() as database:
        for k, file in enumerate(files[:2], 1):
            database.execute(file.read_text())
            database.execute(noted(k))
    for plant in plants:
        site.postgresql.admit(SITE, plant.name)
        plant.start_press()
        plant.start_host()
        plant.stroke()
        plant.end("host")
        multiply(plant, 2000)
        plant.start_host()
        plant.start_forwarder()
    wait("some strokes", lambda: site.postgresql.query("SELECT count(*) > 200 FROM platen.stroke")[0][0])
    (site.folder / "owner").write_text("owner\n")
    apply = lambda: run("forward", "schema", "--apply", plants[0].plant, "--user", OWNER, "--password-file", site.folder / "owner").strip()
    with site.postgresql.connect() as writer, ThreadPoolExecutor(1) as beside:
        # A writer that has the inbox and not yet the tables when the migration begins.
        writer.execute("BEGIN; LOCK TABLE platen.inbox IN ROW EXCLUSIVE MODE")
        migration = beside.submit(apply)
        wait("the migration to wait", lambda: migration.done() or site.postgresql.query(
            "SELECT count(*) > 0 FROM pg_stat_activity WHERE usename = %s AND wait_event_type = 'Lock'", OWNER)[0][0])
        writer.execute("LOCK TABLE platen.stroke, platen.plate, platen.alarm IN ROW EXCLUSIVE MODE; COMMIT")
        applied = migration.result()
    with site.postgresql.connect() as database:
        # As a release to come would: a column that only newer hosts fill.
        database.execute("ALTER TABLE platen.inbox ADD COLUMN later text; ALTER TABLE platen.refill ADD COLUMN later text; ALTER TABLE platen.aside ADD COLUMN later text")
    for plant in plants:
        plant.stroke()
    wait("all strokes", lambda: site.postgresql.query("SELECT count(*), count(acked) FROM platen.stroke") == [(4004, 4004)], 120)
    assert site.postgresql.query("SELECT sum(strokes) FROM platen.plate_course") == [(4004,)]
    with site.postgresql.connect() as database:
        database.execute("CALL platen.rebuild()")
    assert site.postgresql.query("SELECT count(*), count(acked) FROM platen.stroke") == [(4004, 4004)], "built anew from the inbox"
    said(f"{applied} while two hosts wrote; 4,004 strokes; the tables built anew from the inbox: the same")


def check_bad_servers_are_told_in_one_sentence(site):
    """Wrong password, expired certificate, unknown authority, no tables, a broker that never acknowledges: one sentence each, and nothing is lost."""
    plant = one_stroke(site, "postgresql", "mqtt")
    good = plant.sinks

    def told(what, wanted, sinks=None, password="secret"):
        plant.sinks = sinks or good
        plant.write()
        (plant.folder / "password").write_text(password + "\n")
        plant.start_forwarder()
        line = wait(what, lambda: (m := re.search(rf"sink \w+: (.*{wanted}.*)", plant.status())) and m[1])
        plant.end("forwarder")
        assert len([it for it in plant.log().splitlines() if re.search(wanted, it)]) >= 1, plant.log()
        assert "3 changes to send" in line, line
        said(f"{what}: {line}")

    told("wrong password", "password authentication failed.*password_file", site.sinks("postgresql"), "wrong")
    told("wrong password", "refuses the user or the password", site.sinks("mqtt"), "wrong")
    expired = Mosquitto(site.authority, site.folder / "expired", site.authority.sign("expired", ("20240101000000Z", "20240201000000Z")))
    told("expired certificate", "[Ee]xpired", site.sinks("mqtt").replace(str(site.mosquitto.port), str(expired.port)))
    expired.stop()
    (site.folder / "other").mkdir()
    other = Authority(site.folder / "other")
    told("another authority", "BadSignature", site.sinks("postgresql").replace(str(site.authority.file), str(other.file)))
    told("no such database", 'database "elsewhere" does not exist', site.sinks("postgresql") + 'database = "elsewhere"\n')
    told("not on the list of access", "access list", mute_access(site, plant))
    with silent_broker(site.authority) as port:
        told("a broker that never acknowledges", "no answer in 5 s", site.sinks("mqtt").replace(str(site.mosquitto.port), str(port)))
    site.mosquitto.admit_all([plant.user])
    plant.sinks = good
    plant.write()
    (plant.folder / "password").write_text("secret\n")
    assert all(it["backlog"] == 0 and it["sent"] == 3 for it in plant.flush())
    assert site.postgresql.query("SELECT count(*) FROM platen.stroke") == [(1,)]


def mute_access(site, plant):
    """Lets the press's user in, but to no topic."""
    site.mosquitto.admit_all([plant.user])
    access = site.mosquitto.folder / "access"
    access.write_text(f"user reader\ntopic read #\nuser {plant.user}\ntopic write elsewhere\n")
    site.mosquitto.stop()
    site.mosquitto.start()
    return site.sinks("mqtt")


class silent_broker:
    """Accepts connections with TLS and MQTT 5, and never acknowledges a publication."""

    def __init__(self, authority):
        import ssl
        self.context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self.context.load_cert_chain(*authority.sign("silent"))
        self.listener = socket.create_server(("127.0.0.1", 0))

    def __enter__(self):
        def serve():
            while True:
                try:
                    plain, _ = self.listener.accept()
                except OSError:
                    return
                threading.Thread(target=self.one, args=(plain,), daemon=True).start()
        threading.Thread(target=serve, daemon=True).start()
        return self.listener.getsockname()[1]

    def one(self, plain):
        try:
            with self.context.wrap_socket(plain, server_side=True) as connection:
                connection.recv(4096)
                connection.sendall(bytes([0x20, 3, 0, 0, 0]))
                while connection.recv(4096):
                    pass
        except OSError:
            pass

    def __exit__(self, *_):
        self.listener.close()


def check_a_full_disk_of_the_database(site):
    """The database's disk is full: one sentence; room is made: everything is there."""
    small = site.folder / "small"
    small.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=200m", "tmpfs", small], check=True)
    try:
        site.postgresql.stop()
        site.postgresql = Postgresql(site.authority, small / "postgresql")
        plant = one_stroke(site, "postgresql")
        multiply(plant, 500)
        plant.flush()
        filler = small / "filler"
        subprocess.run(["dd", "if=/dev/zero", f"of={filler}", "bs=1M"], capture_output=True)
        multiply(plant, 6000)
        plant.start_forwarder()
        line = wait("a sentence", lambda: (m := re.search(r"sink postgresql: (not connected: .*(No space|disk|recovery|closed|refused).*)", plant.status())) and m[1], 90)
        said(line)
        filler.unlink()
        if site.postgresql.process.poll() is not None:
            site.postgresql.start()
        wait("everything", lambda: json.loads((plant.folder / "results/forward.json").read_text())["sinks"][0]["backlog"] == 0, 120)
        assert site.postgresql.query("SELECT count(*), count(acked) FROM platen.stroke") == [(6501, 6501)]
        plant.end_all()
        site.postgresql.stop(signal.SIGQUIT)
    finally:
        subprocess.run(["umount", "-l", small], check=False)


def check_sparkplug(site):
    """Births, data, history, rebirth on command, death by a broken connection, the primary host's state; decoded by pysparkplug."""
    import pysparkplug
    plant = site.press("press-1", "sparkplug", more='primary_host = "scada"\n')
    site.prepare()
    plant.start_press()
    plant.start_host()
    plant.stroke()
    site.read("spBv1.0/#")
    decoders = {"NBIRTH": pysparkplug.NBirth, "DBIRTH": pysparkplug.DBirth, "NDATA": pysparkplug.NData, "DDATA": pysparkplug.DData, "NDEATH": pysparkplug.NDeath}

    def heard(since=0):
        found = []
        for topic, payload, _ in site.received[since:]:
            kind = topic.split("/")[2]
            if kind in decoders:
                found.append((kind, decoders[kind].decode(payload)))
        return found

    def kinds(since=0):
        return [kind for kind, _ in heard(since)]

    def state(online):
        site.reader.publish("spBv1.0/STATE/scada", json.dumps({"online": online, "timestamp": int(time.time() * 1000)}), qos=1, retain=True).wait_for_publish()
    plant.start_forwarder()
    wait("the connection", lambda: "platen-sparkplug-kure-press-1" in (site.mosquitto.folder / "log").read_text())
    assert kinds() == [], "tck-id-message-flow-edge-node-birth-publish-phid-wait"
    state(True)
    wait("the stroke from before the birth", lambda: "DDATA" in kinds())
    messages = heard()
    births = [it for it in messages if it[0] in ("NBIRTH", "DBIRTH")]
    assert [it[0] for it in births] == ["NBIRTH", "DBIRTH"], births
    numbers = [message.seq for kind, message in messages if kind != "NDEATH"]
    assert numbers == list(range(len(numbers))), ("tck-id-payloads-nbirth-seq, tck-id-payloads-sequence-num-incrementing", numbers)
    metric = lambda message, name: next(it for it in message.metrics if it.name == name)
    bd_seq = metric(births[0][1], "bdSeq").value
    data = next(message for kind, message in messages if kind == "DDATA")
    assert metric(data, "Result/Verdict").value == "fail" and all(it.is_historical for it in data.metrics), "history"
    gap = plant.strokes()[0]["figures"]["gap.max"] * 1000
    assert abs(metric(data, "Result/Gap").value - gap) < 1e-9
    mark = len(site.received)
    plant.stroke()
    wait("a stroke", lambda: "DDATA" in kinds(mark))
    live = next(message for kind, message in heard(mark) if kind == "DDATA")
    assert not any(it.is_historical for it in live.metrics) and metric(live, "Stroke/Run").value == 2
    mark = len(site.received)
    command = pysparkplug.NCmd(timestamp=pysparkplug.get_current_timestamp(), metrics=(pysparkplug.Metric(
        timestamp=pysparkplug.get_current_timestamp(), name="Node Control/Rebirth", datatype=pysparkplug.DataType.BOOLEAN, value=True),))
    site.reader.publish(f"spBv1.0/{SITE}/NCMD/press-1", command.encode(), qos=0)
    wait("births again", lambda: kinds(mark)[:2] == ["NBIRTH", "DBIRTH"])
    again = heard(mark)[0][1]
    assert (again.seq, metric(again, "bdSeq").value) == (0, bd_seq), "tck-id-operational-behavior-data-commands-rebirth-action-2"
    mark = len(site.received)
    plant.end("forwarder", signal.SIGKILL)
    death = wait("the will", lambda: [message for kind, message in heard(mark) if kind == "NDEATH"])[0]
    assert death.bd_seq_metric.value == bd_seq, "tck-id-payloads-ndeath-bdseq"
    plant.stroke()
    mark = len(site.received)
    plant.start_forwarder()
    wait("history", lambda: "DDATA" in kinds(mark))
    born = next(message for kind, message in heard(mark) if kind == "NBIRTH")
    late = next(message for kind, message in heard(mark) if kind == "DDATA")
    assert metric(born, "bdSeq").value == (bd_seq + 1) % 256 and all(it.is_historical for it in late.metrics)
    mark = len(site.received)
    state(False)
    wait("death", lambda: "NDEATH" in kinds(mark))
    plant.stroke()
    line = wait("a sentence", lambda: (m := re.search(r"sink sparkplug: (.*primary host application scada.*)", plant.status())) and m[1])
    mark = len(site.received)
    state(True)
    wait("birth and history", lambda: "DDATA" in kinds(mark), 60)
    said(f"bdSeq {bd_seq}, then {metric(born, 'bdSeq').value}; {len(messages)} messages in sequence; history, rebirth, will, primary host; \"{line}\"")


def check_the_dashboards_answer(site):
    """Every query of the Grafana dashboards runs as a reader, and says what the program says."""
    plant = one_stroke(site, "postgresql")
    plant.start_host()
    for _ in range(4):
        plant.stroke()
    plant.end("host")
    multiply(plant, 200, days=20)
    with plant.database() as database:
        database.execute("UPDATE stroke SET verdict = 'pass' WHERE run_id = (SELECT max(run_id) FROM stroke)")
    plant.flush()
    with site.postgresql.connect() as database:
        database.execute("CREATE ROLE viewer LOGIN PASSWORD 'secret' IN ROLE platen_reader")
    import psycopg
    count = 0
    with psycopg.connect(host="127.0.0.1", port=site.postgresql.port, dbname="platen", user="viewer", password="secret", autocommit=True) as reader:
        for file in dashboards.FILES:
            for panel, sql in dashboards.panels(file):
                sql = dashboards.written_out(sql, "40 days", SITE, "press-1")
                rows = reader.execute(sql).fetchall()
                assert rows or panel.get("description", "").startswith("Empty"), (panel["title"], sql)
                count += 1
        try:
            reader.execute("INSERT INTO platen.inbox SELECT * FROM platen.inbox")
            raise AssertionError("a reader may write")
        except psycopg.errors.InsufficientPrivilege:
            pass
    said(f"{count} queries of {len(dashboards.FILES)} dashboards")


def main():
    global arguments
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    parser.add_argument("--strokes", type=int, default=40)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 30))
    arguments = parser.parse_args()
    print(f"seed {arguments.seed}", flush=True)
    checks = [(name[6:].replace("_", " "), check) for name, check in globals().items() if name.startswith("check_") and arguments.only in name]
    for name, check in checks:
        print(name, flush=True)
        start = time.monotonic()
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            site = Site(folder)
            try:
                check(site)
            except BaseException:
                print([plant.status() for plant in site.presses], file=sys.stderr)
                for plant in site.presses:
                    for log in ("forward.log", "host.log"):
                        if (plant.folder / log).exists():
                            print(f"--- {plant.name} {log}\n{(plant.folder / log).read_text()[-3000:]}", file=sys.stderr)
                raise
            finally:
                site.end()
        print(f"  passed in {time.monotonic() - start:.0f} s", flush=True)
    print(f"{len(checks)} passed, 0 failed")


if __name__ == "__main__":
    main()
