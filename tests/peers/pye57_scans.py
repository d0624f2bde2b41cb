#!/usr/bin/env python3
"""E57 against pye57 (libE57Format): what either writes the other reads with equal values.

    cargo build --release && python3 tests/peers/pye57_scans.py [--rows N --columns N]

Positions come from a closed form here; XYB, which holds plain f64, carries them into and out of the program. Then both
read the same large file, and the points per second and the memory of each are printed. Ends with 0 when all agree."""

import argparse
import json
import os
import subprocess
import sys
import tempfile

import numpy as np
import pye57
from pye57 import libe57

PLATEN = os.path.join(os.path.dirname(__file__), "../../target/release/platen")
GAP = 7  # every GAP-th cell was not measured


def lattice(rows, columns):
    """Row, column, range, azimuth, elevation, intensity and validity of every cell, column by column."""
    column, row = np.divmod(np.arange(rows * columns, dtype=np.int64), rows)
    step = min(1e-3, 1.2 / rows, 3.0 / columns)
    azimuth = -1.5 + step * column + 1e-6 * (row % 5)
    elevation = 0.2 - step * row - 1e-6 * (column % 3)
    distance = 6.0 + 0.3 * np.sin(0.01 * row) + 0.2 * np.cos(0.013 * column)
    return {
        "row": row,
        "column": column,
        "range": distance,
        "azimuth": azimuth,
        "elevation": elevation,
        "intensity": (row * 3 + column * 7) % 2048,
        "valid": (row + 2 * column) % GAP != 0,
    }


def xyz(cells):
    across = cells["range"] * np.cos(cells["elevation"])
    return np.stack(
        [
            across * np.cos(cells["azimuth"]),
            across * np.sin(cells["azimuth"]),
            cells["range"] * np.sin(cells["elevation"]),
        ],
        axis=1,
    )


XYB = np.dtype([("xyz", "<f8", 3), ("intensity", "<u2")])


def write_xyb(path, cells, rows, columns):
    records = np.zeros(rows * columns, XYB)
    valid = cells["valid"]
    records["xyz"][valid] = xyz(cells)[valid]
    records["intensity"][valid] = cells["intensity"][valid]
    with open(path, "wb") as out:
        head = f"# SCENE XYZ binary format v1.0\nScanPosition 0 0 0\nRows {rows}\nCols {columns}\n"
        out.write(head.encode() + b"\0\0\0\0")
        records.tofile(out)


def read_xyb(path):
    with open(path, "rb") as file:
        content = file.read()
    return np.frombuffer(content[content.index(b"\0\0\0\0") + 4 :], XYB)


def platen(*arguments):
    return subprocess.run([PLATEN, *arguments], check=True, capture_output=True, text=True).stdout


def check(what, worst, limit):
    print(f"{what}: largest difference {worst:.3g}, {limit:.3g} allowed")
    assert worst <= limit, what


def ours_to_pye57(folder, cells, rows, columns):
    """A file of ours, read by pye57."""
    write_xyb(f"{folder}/a.xyb", cells, rows, columns)
    platen("convert", f"{folder}/a.xyb", f"{folder}/ours.e57")
    with pye57.E57(f"{folder}/ours.e57") as file:
        assert file.scan_count == 1
        raw = file.read_scan_raw(0)
        points = file.read_scan(0, transform=True, intensity=True, row_column=True, ignore_missing_fields=True)
    truth = {(r, c): i for i, (r, c) in enumerate(zip(cells["row"], cells["column"])) if cells["valid"][i]}
    assert len(raw["rowIndex"]) == len(truth), "number of points"
    place = np.array([truth[(r, c)] for r, c in zip(raw["rowIndex"], raw["columnIndex"])])
    assert len(set(place)) == len(truth), "every cell once"
    for name, field, limit in [("range", "sphericalRange", 1e-14), ("azimuth", "sphericalAzimuth", 1e-14)]:
        check(f"our E57 in pye57, {name}", np.abs(raw[field] - cells[name][place]).max(), limit * 8)
    found = np.stack([points["cartesianX"], points["cartesianY"], points["cartesianZ"]], axis=1)
    check("our E57 in pye57, position", np.abs(found - xyz(cells)[place]).max(), 1e-13)
    check("our E57 in pye57, intensity", np.abs(raw["intensity"] - cells["intensity"][place]).max(), 0)
    assert np.all(raw["sphericalInvalidState"] == 0)


def node(file, kind, values):
    """A prototype's field: float, double, or an integer with a scale."""
    low, high = float(values.min()), float(values.max())
    if kind == "double":
        return libe57.FloatNode(file, low, libe57.E57_DOUBLE, low, high)
    if kind == "single":
        return libe57.FloatNode(file, low, libe57.E57_SINGLE, low - 1e-3, high + 1e-3)
    scale = kind
    ends = [int(np.floor(low / scale)) - 1, int(np.ceil(high / scale)) + 1]
    return libe57.ScaledIntegerNode(file, ends[0], *ends, scale, 0.0)


def write_pye57(path, cells, spherical, kind, flagged, order):
    """Any encoding, through the library's own nodes; `order` is that of the points in the file."""
    keep = order if flagged else order[cells["valid"][order]]
    part = {name: values[keep] for name, values in cells.items()}
    if spherical:
        names, prefix = ["sphericalRange", "sphericalAzimuth", "sphericalElevation"], "spherical"
        values = [part["range"], part["azimuth"], part["elevation"]]
    else:
        names, prefix = ["cartesianX", "cartesianY", "cartesianZ"], "cartesian"
        values = list(xyz(part).T.copy())
    with pye57.E57(path, mode="w") as out:
        file = out.image_file
        scan, prototype = libe57.StructureNode(file), libe57.StructureNode(file)
        scan.set("guid", libe57.StringNode(file, "{0a1b2c3d-0000-4000-8000-000000000001}"))
        for name, v in zip(names, values):
            prototype.set(name, node(file, kind, v))
        integers = {
            "rowIndex": part["row"],
            "columnIndex": part["column"],
            "intensity": part["intensity"],
        }
        if flagged:
            integers[prefix + "InvalidState"] = np.where(part["valid"], 0, 2)
        for name, v in integers.items():
            prototype.set(name, libe57.IntegerNode(file, 0, 0, max(int(v.max()), 2)))
        limits = libe57.StructureNode(file)
        limits.set("intensityMinimum", libe57.IntegerNode(file, 0))
        limits.set("intensityMaximum", libe57.IntegerNode(file, 2047))
        scan.set("intensityLimits", limits)
        columns = {**dict(zip(names, values)), **integers}
        chunk = 1 << 20
        arrays, buffers = out.make_buffers(list(columns), chunk)
        points = libe57.CompressedVectorNode(file, prototype, libe57.VectorNode(file, True))
        scan.set("points", points)
        out.data3d.append(scan)
        writer = points.writer(buffers)
        for start in range(0, len(keep), chunk):
            n = min(chunk, len(keep) - start)
            for name, v in columns.items():
                arrays[name][:n] = v[start : start + n]
            writer.write(n)
        writer.close()


def pye57_to_ours(folder, cells, rows, columns):
    """Files of pye57, read by us."""
    random = np.random.default_rng(7)
    orders = {"column by column": np.arange(rows * columns), "shuffled": random.permutation(rows * columns)}
    number = 0
    for spherical in [False, True]:
        for kind, quantum in [("double", 1e-12), ("single", 8e-7 if not spherical else 3e-6), (1e-5, 5.1e-6)]:
            kind = 1e-6 if spherical and kind == 1e-5 else kind
            for flagged in [True, False]:
                for name, order in orders.items():
                    number += 1
                    path = f"{folder}/theirs-{number}"
                    write_pye57(f"{path}.e57", cells, spherical, kind, flagged, order)
                    platen("convert", f"{path}.e57", f"{path}.xyb")
                    read = read_xyb(f"{path}.xyb")
                    valid = cells["valid"]
                    assert np.all((np.abs(read["xyz"]).sum(axis=1) > 0) == valid), "which cells are valid"
                    assert np.all(read["intensity"][valid] == cells["intensity"][valid]), "intensity"
                    limit = quantum if not (spherical and kind == 1e-6) else 7e-6
                    stored = f"{'spherical' if spherical else 'cartesian'} {kind}"
                    what = f"pye57's E57 in platen, {stored}, gaps {'flagged' if flagged else 'left out'}, {name}"
                    check(what, np.abs(read["xyz"] - xyz(cells))[valid].max(), limit)
                    os.remove(f"{path}.e57")
                    os.remove(f"{path}.xyb")


READ = "import sys, pye57; f = pye57.E57(sys.argv[1]); print(len(f.read_scan_raw(0)['rowIndex']))"


# A process begins with the memory of the one that started it: a small one starts it.
LAUNCH = """
import os, sys
child = os.fork() or os.execv(sys.argv[1], sys.argv[1:])
status, usage = os.wait4(child, 0)[1:]
sys.stderr.write(f"{status} {usage.ru_utime + usage.ru_stime} {usage.ru_maxrss}")
"""


def timed(command):
    """Output, seconds of processor time, largest memory in MB."""
    run = subprocess.run([sys.executable, "-S", "-c", LAUNCH, *command], capture_output=True, text=True)
    status, cpu, memory = run.stderr.split()[-3:]
    assert status == "0", run.stderr
    return run.stdout, float(cpu), int(memory) / 1024


def speed(folder, rows, columns, runs):
    """Both read the same file of pye57's, and of ours."""
    cells = lattice(rows, columns)
    theirs, ours = f"{folder}/large.e57", f"{folder}/large-ours.e57"
    write_pye57(theirs, cells, False, 1e-5, True, np.arange(rows * columns))
    points = int(cells["valid"].sum())
    del cells
    out, cpu, memory = timed([PLATEN, "convert", theirs, ours, "--json"])
    assert json.loads(out)["valid"] == points
    cells_read = rows * columns
    print(f"{rows} x {columns} = {cells_read / 1e6:.1f} M cells, {os.path.getsize(theirs) / 1e6:.0f} MB")
    print(f"  platen convert to E57: {cpu:6.2f} s cpu, {cells_read / cpu / 1e6:5.2f} M cells/s, {memory:5.0f} MB")
    for name, path in [("pye57's file", theirs), ("our file", ours)]:
        best = {}
        for _ in range(runs):
            for reader, command in [
                ("platen inspect", [PLATEN, "inspect", path, "--json"]),
                ("pye57 read_scan_raw", [sys.executable, "-c", READ, path]),
            ]:
                run = timed(command)
                best[reader] = min(best.get(reader, run), run, key=lambda r: r[1])
        for reader, (out, cpu, memory) in best.items():
            if reader == "platen inspect":
                assert json.loads(out)["valid"] == points
            n = cells_read if path == theirs else points
            print(f"  {name}, {reader}: {cpu:6.2f} s cpu, {n / cpu / 1e6:5.2f} M points/s, {memory:5.0f} MB")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=int, default=2500)
    parser.add_argument("--columns", type=int, default=2560)
    parser.add_argument("--runs", type=int, default=2)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows, columns = 150, 230
        cells = lattice(rows, columns)
        ours_to_pye57(folder, cells, rows, columns)
        pye57_to_ours(folder, cells, rows, columns)
        speed(folder, options.rows, options.columns, options.runs)
    print("all agree")


main()
