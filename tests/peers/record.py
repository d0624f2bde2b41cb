#!/usr/bin/env python3
"""Reads a record that was exported by month with DuckDB and pyarrow: Hive's folders, every stroke once, the same values as in one table.

usage: python3 tests/peers/record.py [platen program]
Install: pip install duckdb pyarrow
"""
import pathlib
import sqlite3
import subprocess
import sys
import tempfile

import duckdb
import pyarrow.dataset
import pyarrow.parquet

platen = sys.argv[1] if len(sys.argv) > 1 else "target/release/platen"
SITE = "Nagoya, hall 2"


def run(*command):
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)


def over_months(record):
    """Moves the demo's strokes over the turn of a year, one of them into the last millisecond of a month."""
    with sqlite3.connect(record) as connection:
        runs = [row[0] for row in connection.execute("SELECT run_id FROM stroke ORDER BY run_id")]
        times = ["2025-11-30T23:59:59.999Z", "2025-12-01T00:00:00.000Z", "2025-12-31T12:00:00.000Z", "2026-01-01T00:00:00.000Z"]
        times += ["2026-02-03T04:05:06.007Z"] * (len(runs) - len(times))
        connection.executemany("UPDATE stroke SET accepted = ? WHERE run_id = ?", zip(times, runs))
    return times


with tempfile.TemporaryDirectory() as folder:
    place = pathlib.Path(folder)
    run(platen, "demo", "--out", place / "demo")
    plant, lake, whole = place / "demo" / "plant.toml", place / "lake", place / "whole.parquet"
    times = over_months(place / "demo" / "results" / "history.sqlite")
    run(platen, "history", "export", plant, "--out", whole)
    for _ in range(2):
        run(platen, "history", "export", plant, "--by", "month", "--out", lake, "--site", SITE)
    expected = {time[:7]: times.count(time) + sum(t != time and t[:7] == time[:7] for t in times) for time in times}

    read = f"read_parquet('{lake}/**/*.parquet', hive_partitioning = true, union_by_name = true)"
    found = duckdb.sql(f"SELECT site, year, month, count(*) FROM {read} GROUP BY ALL ORDER BY ALL").fetchall()
    assert [(site, f"{year}-{int(month):02}", n) for site, year, month, n in found] == [(SITE, month, n) for month, n in sorted(expected.items())], found
    differing = duckdb.sql(f"SELECT * EXCLUDE (site, year, month) FROM {read} EXCEPT SELECT * FROM '{whole}'").fetchall()
    assert not differing, differing[:1]

    table = pyarrow.dataset.dataset(lake, partitioning="hive").to_table().sort_by("run_id")
    assert set(table["site"].to_pylist()) == {SITE} and table.num_rows == len(times)
    assert table.drop_columns(["site", "year", "month"]).equals(pyarrow.parquet.read_table(whole)), "not the strokes of the one table"
    print(f"{len(times)} strokes in {len(expected)} months, read by DuckDB and pyarrow as written")
