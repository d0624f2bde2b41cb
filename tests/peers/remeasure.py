#!/usr/bin/env python3
"""Measures a record again as a plant would: one host, then three shards by GNU parallel, each in a network namespace of its own, one of them
killed and resumed. Results are equal to the last bit, to those of `platen measure` too, and the parts are read by DuckDB and pyarrow.

usage: python3 tests/peers/remeasure.py [--plates 6] [platen program]      as root, because of the namespaces
Install: apt-get install parallel util-linux; pip install duckdb pyarrow
"""
import argparse
import json
import os
import pathlib
import signal
import sqlite3
import subprocess
import tempfile
import time

import duckdb
import pyarrow.dataset
import pyarrow.parquet

SHARDS = 3
arguments = argparse.ArgumentParser()
arguments.add_argument("--plates", type=int, default=6)
arguments.add_argument("platen", nargs="?", default="target/release/platen")
given = arguments.parse_args()
platen = str(pathlib.Path(given.platen).resolve())


def run(*command, code=0):
    """Standard output of a command that ends with this code."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == code, f"{command}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def more_plates(results, n_plates):
    """Repeats the demo's plate in its record: the same scans under further run ids."""
    with sqlite3.connect(results / "history.sqlite") as record:
        columns = [row[1] for row in record.execute("PRAGMA table_info(stroke)")]
        strokes = [dict(zip(columns, row)) for row in record.execute("SELECT * FROM stroke ORDER BY run_id")]
        for plate in range(2, n_plates + 1):
            part = ("INSERT INTO plate (plate, press, part_id, began, ended) SELECT ?, press, ?, began, began FROM plate WHERE plate = 1")
            record.execute(part, (plate, 1000 + plate))
            for stroke in strokes:
                old = stroke["run_id"]
                new = old + (plate - 1) * len(strokes)
                folder = results / f"run-{new:06}"
                folder.mkdir()
                for name in ("result.json", "surface.platen", "scan.e57"):
                    os.link(results / f"run-{old:06}" / name, folder / name)
                copy = stroke | {"run_id": new, "plate": plate, "session": 100 + plate, "document": str(folder / "result.json")}
                sql = f"INSERT INTO stroke ({', '.join(copy)}) VALUES ({', '.join('?' * len(copy))})"
                record.execute(sql, list(copy.values()))
    return len(strokes) * n_plates


def shard_process(parent, shard):
    """Number of the program of a shard below `parent`; None where it does not run."""
    children, pending = [], [parent]
    while pending:
        process = pending.pop()
        for task in pathlib.Path(f"/proc/{process}/task").glob("*/children"):
            try:
                below = [int(word) for word in task.read_text().split()]
            except OSError:
                continue
            children += below
            pending += below
    for child in children:
        try:
            words = pathlib.Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if words[0] == platen.encode() and words[1] == b"remeasure" and f"{shard}/{SHARDS}".encode() in words:
            return child
    return None


def document(folder, run_id):
    """A result without the times of its making."""
    result = json.loads((folder / f"run-{run_id:06}" / "result.json").read_text())
    del result["timings_ms"]
    return result


def marks(folder):
    return {mark: mark.stat().st_mtime_ns for mark in folder.glob("run-*/remeasured.json")}


def equal_documents(plant, one, three, results, n_strokes):
    for run_id in range(1, n_strokes + 1):
        assert document(one, run_id) == document(three, run_id), f"run {run_id}"
        name = pathlib.Path(f"run-{run_id:06}") / "surface.platen"
        assert (one / name).read_bytes() == (three / name).read_bytes() == (results / name).read_bytes(), name
    # One stroke by hand.
    scan = lambda run_id: results / f"run-{run_id:06}" / "scan.e57"
    references = ["--before", scan(3), "--baseline", scan(1)] if document(one, 4)["outline"]["from"] == "baseline" else ["--before", scan(3)]
    plate = plant.with_name("plates") / "plate-009.toml"
    by_hand = json.loads(run(platen, "measure", scan(4), *references, "--plate", plate, "--plant", plant, "--json"))
    del by_hand["timings_ms"]
    expected = document(three, 4)
    by_hand["stroke"] = expected["stroke"]
    # Each names the file that it read.
    assert by_hand == expected, [name for name in expected if by_hand[name] != expected[name]]


def read_parts(plant, one, three, n_strokes, place):
    parts = str(three / f"part-*-of-{SHARDS}.parquet")
    strokes, plates = duckdb.sql(f"SELECT count(*), count(DISTINCT plate) FROM '{parts}'").fetchall()[0]
    assert (strokes, plates) == (n_strokes, given.plates), (strokes, plates)
    files = sorted(three.glob(f"part-*-of-{SHARDS}.parquet"))
    assert len(files) == SHARDS
    schema = pyarrow.parquet.read_schema(files[0])
    assert all(pyarrow.parquet.read_schema(file).equals(schema) for file in files), "columns differ between the parts"
    together = pyarrow.dataset.dataset(files).to_table().sort_by("run_id")
    whole = pyarrow.parquet.read_table(one / "part-1-of-1.parquet").sort_by("run_id")
    assert together.equals(whole), "the parts together are not the table of one host"
    differs = duckdb.sql(f"SELECT max(abs(\"difference.gap.max\")), max(\"difference.corners\"), min(\"difference.corners.uncertainty\") FROM '{parts}'")
    gap, corners, uncertainty = differs.fetchall()[0]
    assert gap == 0.0 and corners == 0.0 and uncertainty > 0.0, (gap, corners, uncertainty)
    # A list that DuckDB has selected, in its own compression.
    listed = place / "list.parquet"
    duckdb.sql(f"COPY (SELECT run_id FROM '{parts}' WHERE verdict = 'pass' AND plate = 1) TO '{listed}' (FORMAT parquet)")
    wanted = [row[0] for row in duckdb.sql(f"SELECT run_id FROM '{listed}'").fetchall()]
    some = json.loads(run(platen, "remeasure", plant, "--out", place / "some", "--list", listed, "--json"))
    assert [stroke["run_id"] for stroke in some["strokes"]] == wanted and some["measured"] == len(wanted) > 0
    for run_id in wanted:
        assert document(place / "some", run_id) == document(three, run_id), "measured alone, without the strokes before it"


with tempfile.TemporaryDirectory() as folder:
    place = pathlib.Path(folder)
    run(platen, "demo", "--out", place / "demo")
    plant, results = place / "demo" / "plant.toml", place / "demo" / "results"
    n_strokes = more_plates(results, given.plates)
    one, three = place / "one", place / "three"
    start = time.monotonic()
    alone = json.loads(run(platen, "remeasure", plant, "--out", one, "--compare", "--json"))
    took = time.monotonic() - start
    assert alone["measured"] == n_strokes and not alone["failed"] and not alone["verdict_changed"], alone

    words = ["parallel", "--will-cite", "-j", str(SHARDS), "--joblog", str(place / "joblog")]
    line = ["unshare", "--net", platen, "remeasure", str(plant), "--out", str(three), "--compare", "--shard", f"{{}}/{SHARDS}"]
    shards = [":::", *map(str, range(1, SHARDS + 1))]
    parallel = subprocess.Popen(words + line + shards, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    # The second shard dies in its second plate or later.
    while sum(int(mark.parent.name[4:]) > n_strokes // given.plates for mark in marks(three)) < 3 and parallel.poll() is None:
        time.sleep(0.01)
    victim = shard_process(parallel.pid, 2)
    assert victim, "the second shard has ended before it could be killed; give more --plates"
    os.kill(victim, signal.SIGKILL)
    assert parallel.wait() != 0 and not (three / f"part-2-of-{SHARDS}.parquet").exists()
    before = marks(three)
    assert 0 < len(before) < n_strokes, len(before)
    run(*words, "--resume-failed", "--retries", "2", *line, *shards)
    after = marks(three)
    assert len(after) == n_strokes and all(after[mark] == made for mark, made in before.items()), "a result was made twice"

    equal_documents(plant, one, three, results, n_strokes)
    read_parts(plant, one, three, n_strokes, place)
    again = json.loads(run(platen, "remeasure", plant, "--out", one, "--json"))
    assert (again["measured"], again["skipped"]) == (0, n_strokes), again
    # A plate file that changes makes its strokes anew; a scan that is gone leaves its stroke out.
    plate = plant.with_name("plates") / "plate-009.toml"
    plate.write_text(plate.read_text() + "\n# another edition\n")
    (results / "run-000002" / "scan.e57").unlink()
    anew = json.loads(run(platen, "remeasure", plant, "--out", one, "--plate", "1", "--json"))
    per_plate = n_strokes // given.plates
    assert (anew["measured"], anew["without_scan"]) == (per_plate - 1, 1), anew
    print(f"{n_strokes} strokes of {given.plates} plates, {took / n_strokes:.2f} s each on one host; three shards, one killed after {len(before)} results: "
          "equal to the last bit, read by DuckDB and pyarrow")
