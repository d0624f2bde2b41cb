#!/usr/bin/env python3
"""Reads what a demo left behind with programs that share nothing with us: plyfile, meshio, pyarrow, Python's csv.

usage: platen demo && python3 tests/peers/files.py [FOLDER of the demo] [platen program]
Install: pip install plyfile meshio pyarrow vtk (140 MB: the readers of ParaView)
"""
import csv
import json
import math
import pathlib
import subprocess
import sys
import tempfile

import meshio
import numpy
import pyarrow.parquet
from plyfile import PlyData
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOLegacy import vtkDataSetReader

demo = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "platen-demo")
platen = sys.argv[2] if len(sys.argv) > 2 else "target/release/platen"
runs = sorted((demo / "results").glob("run-*"))
assert runs, f"{demo}: no results; run `platen demo` first"


def same(found, expected, within, what):
    assert abs(found - expected) <= within, f"{what}: {found}, expected {expected}"


def paraview(path, expected, faces):
    """The same mesh and fields in the reader of ParaView."""
    reader = vtkDataSetReader()
    reader.SetFileName(str(path))
    reader.ReadAllScalarsOn()
    reader.Update()
    found = reader.GetOutput()
    assert numpy.array_equal(vtk_to_numpy(found.GetPoints().GetData()), expected.points)
    assert numpy.array_equal(vtk_to_numpy(found.GetCells().GetConnectivityArray()).reshape(-1, 3), faces)
    fields = found.GetPointData()
    assert [fields.GetArrayName(k) for k in range(fields.GetNumberOfArrays())] == list(expected.point_data)
    for name, values in expected.point_data.items():
        assert numpy.array_equal(vtk_to_numpy(fields.GetArray(name)), values.squeeze(), equal_nan=True), name


def mesh(folder):
    """The mesh against the table beside it, node by node, in two readers."""
    ply = PlyData.read(folder / "plate.ply")
    assert not ply.text and ply.byte_order == "<"
    vertex, faces = ply["vertex"], numpy.stack(ply["face"]["vertex_indices"])
    other = meshio.read(folder / "plate.ply")
    assert len(other.points) == vertex.count and len(other.cells_dict["triangle"]) == len(faces)
    vtk = meshio.read(folder / "plate.vtk")
    assert numpy.array_equal(vtk.points, other.points) and numpy.array_equal(vtk.cells_dict["triangle"], faces)
    rows = list(csv.DictReader((folder / "grid.csv").open()))
    assert len(rows) == vertex.count
    fields = [p.name for p in vertex.properties if p.name.startswith("scalar_")]
    assert {"scalar_u_mm", "scalar_v_mm", "scalar_deviation_mm", "scalar_kappa_u_per_m"} <= set(fields), fields
    assert [name.removeprefix("scalar_") for name in fields] == list(vtk.point_data)
    for name in fields:
        column = name.removeprefix("scalar_")
        assert numpy.array_equal(vertex[name], vtk.point_data[column].squeeze(), equal_nan=True), column
        for found, row in zip(vertex[name], rows):
            if row[column] == "":
                assert math.isnan(found), f"{column}: {found} where the table has nothing"
            else:
                same(found, float(row[column]), 1e-6 + 1e-6 * abs(found), column)
    paraview(folder / "plate.vtk", vtk, faces)
    points = numpy.stack([vertex[axis] for axis in "xyz"], axis=1)
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = 0.5 * numpy.linalg.norm(numpy.cross(b - a, c - a), axis=1).sum()
    plate = json.load((folder / "result.json").open())["plate_file"]
    seen = sum(row["seen"] == "1" for row in rows) / len(rows)
    expected = plate["width_mm"] * plate["height_mm"] * 1e-6 * seen
    same(area / expected, 1.0, 0.02, "area of the mesh")
    return len(faces), len(fields)


def history():
    """The history as Parquet against the same as CSV."""
    with tempfile.TemporaryDirectory() as folder:
        files = [pathlib.Path(folder) / f"strokes.{end}" for end in ("parquet", "csv")]
        for file in files:
            subprocess.run([platen, "history", "export", demo / "plant.toml", "--out", file], check=True, stdout=subprocess.DEVNULL)
        table = pyarrow.parquet.read_table(files[0])
        rows = list(csv.DictReader(files[1].open()))
    assert table.num_rows == len(rows) == len(runs)
    assert table.column_names == list(rows[0])
    assert str(table.schema.field("accepted").type) == "timestamp[ms, tz=UTC]"
    assert str(table.schema.field("run_id").type) == "uint32"
    for name in table.column_names:
        for cell, row in zip(table[name].to_pylist(), rows):
            text = row[name]
            match cell:
                case None:
                    assert text == "", f"{name}: {text} where Parquet has nothing"
                case bool():
                    assert text == str(cell).lower()
                case int() | float():
                    same(float(text), cell, 0.0, name)
                case str():
                    assert text == cell
                case _:
                    assert text == cell.strftime("%Y-%m-%dT%H:%M:%S.") + f"{cell.microsecond // 1000:03}Z"
    return table.num_columns


for run in runs:
    triangles, fields = mesh(run)
columns = history()
print(f"{len(runs)} strokes: meshes of {triangles} triangles with {fields} fields, history of {columns} columns; all as written")
