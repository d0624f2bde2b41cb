"""The harmonic map against libigl, on the same meshes: places to 1e-6 of the plate, and the times of one run.

    python3 -m pip install libigl numpy
    python3 tests/peers/flattening.py

Exits 1 when a mesh disagrees. The meshes and our charts come from `core/shape/examples/harmonic_charts.rs`; the map in
there is what `plugins/harmonic` calls. The times, one thread, the best of five, hold for this machine only; their
quotient is what counts.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import igl
import numpy as np

ALLOWED = 1e-6
WORKSPACE = Path(__file__).resolve().parents[2]


def charts(folder):
    command = ["cargo", "run", "--release", "--quiet", "-p", "platen-shape", "--features", "closed-form"]
    subprocess.run(command + ["--example", "harmonic_charts", "--", folder], cwd=WORKSPACE, check=True)
    return sorted(Path(folder).glob("*.json"), key=lambda path: path.stat().st_size)


def peer(chart):
    """libigl's map and its best time in milliseconds."""
    vertices = np.array(chart["vertices_m"], order="F")
    triangles = np.array(chart["triangles"], dtype=np.int64, order="F")
    boundary = np.array(chart["boundary"], dtype=np.int64)
    places = np.array(chart["boundary_uv_m"], order="F")
    best = float("inf")
    for _ in range(5):
        start = time.perf_counter()
        uv = igl.harmonic(vertices, triangles, boundary, places, 1)
        best = min(best, (time.perf_counter() - start) * 1e3)
    return uv, best


def main():
    agrees = True
    print(f"{'mesh':<12} {'vertices':>8} {'apart/plate':>12} {'ours ms':>8} {'libigl ms':>10} {'ratio':>6}")
    with tempfile.TemporaryDirectory() as folder:
        for path in charts(folder):
            chart = json.loads(path.read_text())
            uv, ms = peer(chart)
            apart = np.abs(uv - np.array(chart["uv_m"])).max() / max(chart["size_m"])
            agrees &= bool(apart <= ALLOWED)
            print(f"{path.stem:<12} {len(uv):>8} {apart:>12.1e} {chart['ms']:>8.1f} {ms:>10.1f} {ms / chart['ms']:>6.2f}")
    print("agree" if agrees else f"DISAGREE by more than {ALLOWED} of the plate")
    return 0 if agrees else 1


if __name__ == "__main__":
    sys.exit(main())
