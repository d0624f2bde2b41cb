"""Makes this folder from the large samples: python3 crop.py LARGE_SAMPLES. Needs pye57 and numpy. README.md has the format."""
import gzip, json, shutil, sys
from pathlib import Path

import numpy as np
import pye57

LARGE, HERE = Path(sys.argv[1]), Path(__file__).parent
QUANTUM = 5e-5  # metres
MARGIN = 24  # cells round the plate
PUMP_COLUMNS = 60


def e57(path):
    """Cells as [column][row][xyz], NaN where there is none."""
    data = pye57.E57(str(path)).read_scan_raw(0)
    column, row = (data[k].astype(int) for k in ("columnIndex", "rowIndex"))
    xyz = np.full((column.max() + 1, row.max() + 1, 3), np.nan)
    points = np.stack([data["cartesian" + k] for k in "XYZ"], 1)
    state = data.get("cartesianInvalidState", np.zeros(len(points)))
    points[(state != 0) | (points == 0).all(1)] = np.nan
    xyz[column, row] = points
    return xyz


def ptx(path):
    lines = gzip.open(path, "rt").read().split("\n")
    n_columns, n_rows = int(lines[0]), int(lines[1])
    xyz = np.array([[float(x) for x in line.split()[:3]] for line in lines[10:] if line.strip()])
    xyz[(xyz == 0).all(1)] = np.nan
    return xyz.reshape(n_columns, n_rows, 3)


def rounded(value, digits):
    if isinstance(value, float):
        return round(value, digits)
    if isinstance(value, list):
        return [rounded(v, digits) for v in value]
    return value


def plate(source, target):
    target.mkdir(parents=True)
    truth, job = (json.loads((source / name).read_text()) for name in ("truth.json", "job.json"))
    xyz = e57(source / "scan.e57") if (source / "scan.e57").exists() else ptx(source / "scan.ptx.gz")
    lattice = truth["lattice"]
    step, azimuth, elevation = lattice["step_deg"], lattice["az_first_deg"], lattice["el_first_deg"]
    grid = np.array(truth["surface_grid"]["xyz_m"]).reshape(-1, 3)
    column = (azimuth - np.degrees(np.arctan2(grid[:, 1], grid[:, 0]))) / step
    row = (elevation - np.degrees(np.arcsin(grid[:, 2] / np.linalg.norm(grid, axis=1)))) / step
    first = [max(int(x.min()) - MARGIN, 0) for x in (column, row)]
    last = [min(int(x.max()) + MARGIN, n) for x, n in zip((column, row), xyz.shape)]
    crop = xyz[first[0] : last[0], first[1] : last[1]]
    ranges = np.round(np.nan_to_num(np.linalg.norm(crop, axis=2)) / QUANTUM).astype(np.int64)
    before = np.pad(ranges, ((1, 0), (1, 0)))
    residual = ranges - (before[:-1, 1:] + before[1:, :-1] - before[:-1, :-1])
    zigzag = (residual << 1) ^ (residual >> 63)
    planes = b"".join((zigzag >> shift & 255).astype(np.uint8).tobytes() for shift in (0, 8, 16))
    (target / "ranges.gz").write_bytes(gzip.compress(planes, 9, mtime=0))

    lattice["az_first_deg"] = azimuth - step * first[0]
    lattice["el_first_deg"] = elevation - step * first[1]
    lattice["ncol"] = lattice["file_cols"] = crop.shape[0]
    lattice["nrow"] = lattice["file_rows"] = crop.shape[1]
    truth["counts"]["cells"] = crop.shape[0] * crop.shape[1]
    truth["counts"]["valid_cells"] = int((ranges > 0).sum())
    kept = ("name", "seed", "plate", "shape", "pose", "scanner", "lattice", "corners_m", "u_axis_hint", "markers",
            "surface_grid", "curvature_grid_mid", "displacement_grid_mm", "counts")  # fmt: skip
    truth = {key: truth[key] for key in kept if key in truth}
    for key in ("k_max", "k_min"):
        truth["curvature_grid_mid"].pop(key, None)
    for key, digits in (("curvature_grid_mid", 7), ("displacement_grid_mm", 4)):
        if key in truth:
            truth[key] = {k: rounded(v, digits) for k, v in truth[key].items()} if isinstance(truth[key], dict) else rounded(truth[key], digits)
    (target / "truth.json.gz").write_bytes(gzip.compress(json.dumps(truth, separators=(",", ":")).encode(), 9, mtime=0))
    for line in job["reference_lines"]:
        line["uv_mm"] = [line["uv_mm"][0], line["uv_mm"][-1]]
    (target / "job.json").write_text(json.dumps(job) + "\n")


def pump(source, target):
    """The first columns of the pump, in the four formats that the large samples have it in."""
    target.mkdir(parents=True)
    data = pye57.E57(str(source / "pumpA.e57")).read_scan_raw(0)
    first = data["columnIndex"] < PUMP_COLUMNS
    names = ["cartesianX", "cartesianY", "cartesianZ", "intensity", "rowIndex", "columnIndex"]
    file = pye57.E57(str(target / "pumpA.e57"), mode="w")
    file.write_scan_raw({name: data[name][first] for name in names})
    file.close()

    def packed(name, change):
        content = change(gzip.decompress((source / name).read_bytes()))
        (target / name).write_bytes(gzip.compress(content, 9, mtime=0))

    def text(lines):
        return b"".join(line + b"\n" for line in lines)

    low, high = (int(f(data["rowIndex"][first])) for f in (np.min, np.max))

    def ptx_head(content, columns, end):
        """The first columns, in the rows that hold something."""
        lines = content.split(b"\n")
        cells = [lines[10 + 1074 * c + r] for c in range(columns) for r in range(low, high + 1)]
        return text([str(columns).encode() + end, str(high - low + 1).encode() + end, *lines[2:10], *cells])

    packed("pumpA_lf.ptx.gz", lambda c: ptx_head(c, PUMP_COLUMNS, b""))
    packed("pumpA_crlf_head.ptx.gz", lambda c: ptx_head(c, 40, b"\r"))
    packed("pumpA_rowcol.xyz.gz", lambda c: text(line for line in c.splitlines() if int(line.split()[1]) < PUMP_COLUMNS))
    head = b"\0\0\0\0"  # ends the header; 26 bytes a hit follow
    end = lambda c: c.index(head) + len(head) + 26 * int(first.sum())
    packed("pumpA.xyb.gz", lambda c: c[: end(c)].replace(b"Cols 345", b"Cols %d" % PUMP_COLUMNS))
    shutil.copy(source / "complex-transform.ptx", target)


for folder in ("plates", "lattice", "e57"):
    shutil.rmtree(HERE / folder, ignore_errors=True)
for source in sorted((LARGE / "plates").iterdir()):
    if source.is_dir():
        plate(source, HERE / "plates" / source.name)
pump(LARGE / "lattice", HERE / "lattice")
shutil.copytree(LARGE / "e57", HERE / "e57", ignore=shutil.ignore_patterns("unorganised_*"))
