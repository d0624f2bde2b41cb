"""The fitted surface against scipy's splines, on the same points and knots: places, accuracy, and the times of one run.

    python3 -m pip install scipy numpy
    python3 tests/peers/surface.py

Two peers: FITPACK (`LSQBivariateSpline`, plain least squares, once for each of x, y, z) and the normal equations of
`BSpline.design_matrix` by a sparse solver (one matrix, three right-hand sides). Without noise all three are one spline. With noise, along z,
and as many points as on a scanned plate, ours is smoothed and has to be nearer to the truth along the normal. Exits 1 when not.

A known limit shows with few noisy points (10,000, 35 mm apart) and is not judged: the one smoothing for all three coordinates is chosen along the
normal, and for a rolled plate it then flattens the places within the surface by millimetres.

The points and our fits come from `tests/examples/surface_fits.rs`. The times, one thread, hold for this machine only; their quotient is
what counts.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.interpolate import BSpline, LSQBivariateSpline
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

# Metres, on a plate of 4 m without noise: the penalty of the smoothed fit is all that is left.
ALLOWED = 1e-6
# Points of a scanned plate, about.
SCANNED = 100_000
WORKSPACE = Path(__file__).resolve().parents[2]


def fits(folder):
    command = ["cargo", "run", "--release", "--quiet", "-p", "platen-tests", "--example", "surface_fits", "--", folder]
    subprocess.run(command, cwd=WORKSPACE, check=True)
    return sorted(Path(folder).glob("*.json"), key=lambda path: path.stat().st_size)


def timed(work, repeat):
    best = float("inf")
    for _ in range(repeat):
        start = time.perf_counter()
        result = work()
        best = min(best, (time.perf_counter() - start) * 1e3)
    return result, best


def fitpack(uv, points, places, size, spans):
    """Plain least squares, each coordinate by itself."""
    inner = [np.linspace(0, length, spans + 1)[1:-1] for length in size]
    box = [0, size[0], 0, size[1]]

    def work():
        return [LSQBivariateSpline(uv[:, 0], uv[:, 1], points[:, k], *inner, bbox=box, kx=3, ky=3) for k in range(3)]

    # Minutes for the largest case: once has to do.
    splines, ms = timed(work, 1 if len(uv) >= SCANNED else 3)
    return np.stack([s.ev(places[:, 0], places[:, 1]) for s in splines], axis=1), ms


def rows(uv, knots):
    """Products of the basis functions of both directions at each point, as a sparse matrix."""
    one, other = (BSpline.design_matrix(uv[:, k], knots[k], 3) for k in range(2))
    n, width = len(uv), len(knots[1]) - 4
    data = (one.data.reshape(n, 4, 1) * other.data.reshape(n, 1, 4)).reshape(-1)
    columns = (one.indices.reshape(n, 4, 1) * width + other.indices.reshape(n, 1, 4)).reshape(-1)
    shape = (n, (len(knots[0]) - 4) * width)
    return csr_array((data, columns, np.arange(0, 16 * n + 1, 16)), shape=shape)


def sparse(uv, points, places, size, spans):
    """Plain least squares by the normal equations."""
    knots = [np.concatenate(([0] * 3, np.linspace(0, length, spans + 1), [length] * 3)) for length in size]

    def work():
        matrix = rows(uv, knots)
        return splu((matrix.T @ matrix).tocsc()).solve(matrix.T @ points)

    control, ms = timed(work, 5)
    return rows(places, knots) @ control, ms


def errors(found, true, radius):
    """Root mean square distance from the truth along the normal of the rolled plate and within it."""
    normal = (np.array([0.0, 0.0, radius]) - true) * [1.0, 0.0, 1.0] / radius
    off = found - true
    height = (off * normal).sum(axis=1)
    return np.sqrt((height**2).mean()), np.sqrt(((off - height[:, None] * normal) ** 2).sum(axis=1).mean())


def main():
    sound = True
    print(
        f"{'points':<11} {'spans':>5} {'apart mm':>9} {'ours: normal, along mm':>22} {'plain: normal, along mm':>23}"
        f" {'ours ms':>8} {'FITPACK ms':>10} {'ratio':>6} {'sparse ms':>9} {'ratio':>6}"
    )
    with tempfile.TemporaryDirectory() as folder:
        for path in fits(folder):
            case = json.loads(path.read_text())
            uv, points, places, true, ours = (
                np.array(case[name]) for name in ("uv_m", "points_m", "places_m", "true_m", "fitted_m")
            )
            size, spans = case["size_m"], case["spans"]
            plain, fitpack_ms = fitpack(uv, points, places, size, spans)
            direct, sparse_ms = sparse(uv, points, places, size, spans)
            peers_apart = np.abs(plain - direct).max()
            apart = np.abs(ours - plain).max()
            (error, along), (plain_error, plain_along) = (errors(s, true, case["radius_m"]) for s in (ours, plain))
            sound &= bool(peers_apart <= ALLOWED)
            if case["noise_m"] == 0:
                sound &= bool(apart <= ALLOWED)
            elif len(uv) >= SCANNED:
                sound &= bool(error <= plain_error)
            ms = case["ms"]
            print(
                f"{path.stem:<11} {spans:>5} {1e3 * apart:>9.5f} {1e3 * error:>11.5f} {1e3 * along:>10.5f}"
                f" {1e3 * plain_error:>12.5f} {1e3 * plain_along:>10.5f}"
                f" {ms:>8.1f} {fitpack_ms:>10.1f} {fitpack_ms / ms:>6.1f} {sparse_ms:>9.1f} {sparse_ms / ms:>6.1f}"
            )
    print("sound" if sound else "NOT SOUND: a fit disagrees without noise, or is worse along the normal than plain least squares with noise")
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
