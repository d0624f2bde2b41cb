#!/usr/bin/env python3
"""Reading speed of one scan as E57, PTX and XYZ beside pye57 (libE57Format), numpy and CloudCompare, where they read the format.

    cargo build --release && taskset -c 2,3 python3 tests/peers/read_speed.py SCAN [--runs N]

The scan is converted by the program. Readers take turns, each in a process of its own; printed are medians of wall and
processor time, a process that only starts and loads its libraries taken off, and the largest memory. The program orients the
lattice and checks every page; the others only fill arrays. Judges nothing; ends with 0 when all counted the same valid cells."""

import argparse
import importlib.util
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile

PLATEN = os.path.join(os.path.dirname(__file__), "../../target/release/platen")

PYE57 = """
import sys, numpy, pye57
if len(sys.argv) > 1:
    raw = pye57.E57(sys.argv[1]).read_scan_raw(0)
    states = [name for name in raw if name.endswith("InvalidState")]
    print(int((raw[states[0]] == 0).sum()) if states else len(raw["rowIndex"]))
"""
NUMPY = """
import sys, numpy
if len(sys.argv) > 1:
    skip, position = int(sys.argv[2]), int(sys.argv[3])
    cells = numpy.loadtxt(sys.argv[1], skiprows=skip)
    print(int((cells[:, position:position + 3] != 0).any(axis=1).sum()))
"""

# A process begins with the memory of the one that started it: a small one starts it.
LAUNCH = """
import os, sys, time
start = time.perf_counter()
child = os.fork() or os.execvp(sys.argv[1], sys.argv[1:])
status, usage = os.wait4(child, 0)[1:]
wall = time.perf_counter() - start
sys.stderr.write(f"\\n{status} {wall} {usage.ru_utime + usage.ru_stime} {usage.ru_maxrss}")
"""


def timed(command):
    """Output, and seconds of wall time, seconds of processor time, MB."""
    run = subprocess.run([sys.executable, "-S", "-c", LAUNCH, *command], capture_output=True, text=True)
    status, wall, cpu, memory = run.stderr.split()[-4:]
    assert status == "0", run.stderr
    return run.stdout, (float(wall), float(cpu), int(memory) / 1024)


def readers(extension, path):
    """Name, command that reads, command that only starts."""
    python = [sys.executable, "-c"]
    yield "platen", [PLATEN, "inspect", path, "--json"], [PLATEN, "--version"]
    if extension == "e57" and importlib.util.find_spec("pye57"):
        yield "pye57", [*python, PYE57, path], [*python, PYE57]
    if extension != "e57":
        head, position = ("10", "0") if extension == "ptx" else ("0", "2")
        yield "numpy loadtxt", [*python, NUMPY, path, head, position], [*python, NUMPY]
    if extension != "e57" and shutil.which("CloudCompare"):
        cloudcompare = ["env", "QT_QPA_PLATFORM=offscreen", "CloudCompare", "-SILENT", "-NO_TIMESTAMP"]
        yield "CloudCompare", [*cloudcompare, "-O", path], cloudcompare


def valid(name, out):
    """Valid cells that a reader counted."""
    match name:
        case "platen":
            return json.loads(out)["valid"]
        case "CloudCompare":
            return int(re.search(r"with (\d+) points", out)[1])
        case _:
            return int(out)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scan")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for extension in ["e57", "ptx", "xyz"]:
            path = f"{folder}/scan.{extension}"
            if options.scan.endswith("." + extension):
                shutil.copy(options.scan, path)
            else:
                subprocess.run([PLATEN, "convert", options.scan, path], check=True, capture_output=True)
            size = os.path.getsize(path) / 1e6
            counts, reads, starts = set(), {}, {}
            for _ in range(options.runs):
                for name, read, start in readers(extension, path):
                    out, figures = timed(read)
                    counts.add(valid(name, out))
                    reads.setdefault(name, []).append(figures)
                    starts.setdefault(name, []).append(timed(start)[1])
            assert len(counts) == 1, f"{extension}: valid cells {counts}"
            points = counts.pop()
            for name, runs in reads.items():
                wall, cpu, memory = (statistics.median(figure) for figure in zip(*runs))
                start_wall, start_cpu, _ = (statistics.median(figure) for figure in zip(*starts[name]))
                wall, cpu = wall - start_wall, cpu - start_cpu
                rate = points / wall / 1e6
                print(
                    f"{extension} ({size:.0f} MB, {points} valid) {name}: {wall:.2f} s wall, {cpu:.2f} s cpu,"
                    f" {rate:.2f} M points/s, {memory:.0f} MB",
                    flush=True,
                )


main()
