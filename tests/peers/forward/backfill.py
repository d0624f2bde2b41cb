#!/usr/bin/env python3
"""How quickly a year of many presses comes into PostgreSQL through the inbox and its triggers.

    apt-get install postgresql mosquitto openssl; pip install psycopg[binary] paho-mqtt jsonschema; cargo build --release
    python3 tests/peers/forward/backfill.py --strokes 40000 --connections 1 2 4

A press makes one stroke; its messages are repeated under other keys, times and plates. The server's side: batches of 100 by the forwarder's own statement, over TLS, by
the role of one press a connection, first `finished` alone, then all three messages of a stroke. The whole way: `platen forward --from DATE --until-sent`
on records of `--records` strokes, one and two presses at once. Every row must be in the tables, else the exit code is 1; the rates are printed and judge nothing.
"""
import argparse, hashlib, json, multiprocessing, re, sys, tempfile, time
from datetime import datetime, timedelta, timezone
from pathlib import Path

import psycopg

from forward import SITE, Site, one_stroke
from servers import ROOT, Postgresql, multiply

YEAR = 29e6
BATCH = 100
INSERT = re.search(r'const INSERT: &str = "(.*?)";', (ROOT / "core/forward/src/postgresql.rs").read_text(), re.S)[1].replace("\\\n", " ")


def told(what, rows, took, of="strokes"):
    rate = rows / took
    print(f"  {what}: {rows} {of} in {took:.1f} s, {rate:.0f}/s; 29 million in {YEAR / rate / 3600:.1f} h", flush=True)


def batches(press, kinds, strokes, models):
    """Arrays of the statement, a batch each, oldest first over half a year before now."""
    now = datetime.now(timezone.utc)
    rows, made = [], []
    for n in range(1, strokes + 1):
        at = (now - timedelta(days=180) * (1 - n / strokes)).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"
        for kind in kinds:
            document = models[kind]
            document["press"], document["id"], document["at"] = press, n, at
            document["stroke"]["accepted"] = document["plate"]["began"] = at
            document["stroke"]["key"] |= {"session": n // 60000 + 1, "stroke": n % 60000}
            document["plate"]["number"] = 1 + n // 12
            text = json.dumps(document, separators=(",", ":"))
            rows.append((document["owner"], kind, n, at, hashlib.sha256(text.encode()).hexdigest(), text))
    for start in range(0, len(rows), BATCH):
        made.append([list(column) for column in zip(*rows[start:start + BATCH])])
    return made


def send(port, authority, press, kinds, strokes, models, ready):
    """One press: makes its batches, waits for the others, sends."""
    writer = models["finished"]["owner"]
    made = batches(press, kinds, strokes, models)
    with psycopg.connect(host="localhost", port=port, dbname="platen", user=f"{SITE}/{press}", password="secret", autocommit=True, sslmode="verify-full",
                         sslrootcert=authority, cursor_factory=psycopg.RawCursor) as database:
        ready.wait()
        for columns in made:
            database.execute(INSERT, [SITE, press, writer, [], *columns], prepare=True)


def of_the_server(site, models, connections, kinds, strokes):
    """Sends from this many connections at once; every stroke is in the table then, and nothing is aside."""
    postgresql, each = site.postgresql, strokes // connections
    presses = [f"{'-'.join(kinds)}-{connections}-{k}" for k in range(connections)]
    for press in presses:
        postgresql.admit(SITE, press)
    ready = multiprocessing.Barrier(connections + 1)
    senders = [multiprocessing.Process(target=send, args=(postgresql.port, str(site.authority.file), press, kinds, each, models, ready)) for press in presses]
    before = postgresql.query("SELECT pg_database_size('platen')")[0][0]
    for sender in senders:
        sender.start()
    ready.wait()
    began = time.monotonic()
    for sender in senders:
        sender.join()
        assert sender.exitcode == 0
    took = time.monotonic() - began
    done = postgresql.query("SELECT count(*), count(acked) FROM platen.stroke WHERE press = ANY (%s)", presses)
    assert done == [(each * connections, each * connections if "acked" in kinds else 0)], done
    assert postgresql.query("SELECT count(*) FROM platen.aside") == [(0,)]
    told(f"server, {connections} connections, {', '.join(kinds)}", each * connections, took)
    return (postgresql.query("SELECT pg_database_size('platen')")[0][0] - before) / (each * connections)


def of_the_program(site, presses, strokes):
    """`platen forward` of some presses at once, each on a record of its own."""
    plants = [site.press(f"record-{len(presses)}-{name}", "postgresql") for name in presses]
    for plant in plants:
        site.postgresql.admit(SITE, plant.name)
        plant.start_press()
        plant.start_host()
        plant.stroke()
        plant.end_all()
        multiply(plant, strokes - 1, days=180)
    began = time.monotonic()
    for plant in plants:
        plant.start_forwarder("--from", "2026-01-01", "--until-sent")
    for plant in plants:
        assert plant.forwarder.wait() == 0, plant.log()
    took = time.monotonic() - began
    done = site.postgresql.query("SELECT count(*), count(acked) FROM platen.stroke WHERE press = ANY (%s)", [it.name for it in plants])
    assert done == [(strokes * len(plants),) * 2], done
    told(f"platen forward, {len(plants)} presses, three messages a stroke", strokes * len(plants), took)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strokes", type=int, default=20000)
    parser.add_argument("--records", type=int, default=5000)
    parser.add_argument("--connections", type=int, nargs="+", default=[1, 2, 4])
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="platen-backfill-", dir="/var/tmp") as folder:
        site = Site(folder)
        try:
            site.postgresql.stop()
            site.postgresql = Postgresql(site.authority, Path(folder) / "filled", settings="")
            plant = one_stroke(site, "postgresql")
            plant.flush()
            plant.end_all()
            models = dict(site.postgresql.query("SELECT kind, doc FROM platen.inbox"))
            sizes = {kind: len(json.dumps(document)) for kind, document in models.items()}
            print(f"messages of a stroke, bytes: {sizes}", flush=True)
            for connections in options.connections:
                size = of_the_server(site, models, connections, ["finished"], options.strokes)
            print(f"  {size:.0f} bytes a stroke on disk, {YEAR * size / 1e9:.0f} GB a year", flush=True)
            of_the_server(site, models, max(options.connections), ["accepted", "finished", "acked"], options.strokes)
            of_the_program(site, ["a"], options.records)
            of_the_program(site, ["a", "b"], options.records)
        finally:
            site.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
