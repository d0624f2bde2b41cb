#!/usr/bin/env python3
"""A year of many presses in PostgreSQL: how long the questions of a shift and of a fleet take.

    apt-get install postgresql; pip install psycopg[binary]
    python3 tests/peers/forward/year.py --presses 200 --days 36          (2.85 million strokes; 365 days: 29 million)

Plates of twelve strokes, 33 plates a press and day, written into the tables by SQL, past the inbox. Every query of the dashboards is asked twice, the second
time is told: the last day of one press within 1 s, the last month of all within 10 s, else its plan is printed and the exit code is 1.
"""
import argparse, signal, sys, tempfile, time
from pathlib import Path

import dashboards
from servers import ROOT, Authority, Postgresql

PLATES = 33
# Dashboard -> time that it is asked for, and limit of each answer, seconds.
SPANS = {"press": ("1 day", 1), "plant": ("30 days", 10)}

FILL = """
INSERT INTO platen.stroke (site, press, owner, run_id, accepted, scanned, finished, acked, ack, session, stroke, attempt, plate, part_id, part_name, recipe, baseline,
    dry_run, crew, verdict, gap_max_mm, gap_uncertainty_mm, sense, deviation_rms_mm, deviation_max_mm, deviation_min_mm, coverage, ram_depth_mm, force_kn,
    stroke_to_result_s, says, figures, bends)
SELECT 'site ' || press % 4, 'press ' || press, 1, run, at, at + interval '1 second', at + interval '2 seconds', at + interval '3 seconds', 'acked', 1, n, 0, plate,
    plate, 'A' || plate, 1 + plate % 5, false, false, 1 + (run / 150) % 3,
    CASE WHEN n = 12 THEN 'pass' WHEN run % 97 = 0 THEN 'not_measured' ELSE 'fail' END,
    40.0 / n, 0.2, CASE WHEN run % 41 = 0 THEN 1 ELSE -1 END, 1.0, 2.0, -2.0, 0.99, 5.0, 900, 1.2, 'not far enough',
    jsonb_build_object('gap.max', 0.04 / n, 'gap.uncertainty', 0.0002, 'coverage', 0.99, 'sense', -1, 'deviation.rms', 0.001),
    jsonb_build_array(jsonb_build_object('at_mm', jsonb_build_array(200 + 250 * n, 1250), 'angle_deg', 1.9, 'direction_deg', 90, 'length_mm', 2500, 'width_mm', 180))
FROM (SELECT press, run, run / 12 AS plate, 1 + run % 12 AS n,
    '{day}'::timestamptz + (run % (12 * {plates})) * (interval '1 day' / (12 * {plates})) AS at
    FROM generate_series(1, {presses}) press, generate_series({first}::bigint, {first}::bigint + 12 * {plates} - 1) run) AS one
"""
PLATE = """
INSERT INTO platen.plate (site, press, owner, plate, part_id, part_name, began, ended)
SELECT site, press, owner, plate, min(part_id), min(part_name), min(accepted), max(accepted) FROM platen.stroke GROUP BY 1, 2, 3, 4
"""


def fill(database, options):
    """Strokes of the year, a day at a time, newest day last."""
    for day in range(options.days):
        at = database.execute("SELECT date_trunc('day', now(), 'UTC') - %s * interval '1 day'", [options.days - 1 - day]).fetchone()[0]
        database.execute("SELECT platen.make_partition(%s)", [at])
        first = 12 * PLATES * day + 12
        database.execute(FILL.format(day=at, plates=PLATES, presses=options.presses, first=first))
    database.execute(PLATE)
    database.execute("ANALYZE platen.stroke, platen.plate")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--presses", type=int, default=20)
    parser.add_argument("--days", type=int, default=90)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="platen-year-", dir="/var/tmp") as folder:
        folder = Path(folder)
        folder.chmod(0o755)
        server = Postgresql(Authority(folder), folder / "postgresql", settings="")
        try:
            with server.connect() as database:
                for file in sorted((ROOT / "core/forward/sql").glob("*.sql")):
                    database.execute(file.read_text())
                began = time.monotonic()
                fill(database, options)
                strokes, = database.execute("SELECT count(*) FROM platen.stroke").fetchone()
                size = database.execute("SELECT pg_database_size('platen') / 1e9").fetchone()[0]
                print(f"{strokes} strokes of {options.presses} presses in {options.days} days, filled in {time.monotonic() - began:.0f} s; "
                      f"{size:.1f} GB on disk", flush=True)
                slow = 0
                for file in dashboards.FILES:
                    span, limit_s = SPANS[file.stem]
                    for panel, sql in dashboards.panels(file):
                        asked = dashboards.written_out(sql, span, "site 1", "press 1")
                        for _ in range(2):
                            began = time.monotonic()
                            rows = len(database.execute(asked).fetchall())
                            took = time.monotonic() - began
                        print(f"{took:8.2f} s  {rows:6} rows  {file.stem}: {panel['title']}", flush=True)
                        if took > limit_s:
                            slow += 1
                            print("\n".join(line for line, in database.execute(f"EXPLAIN (ANALYZE, BUFFERS) {asked}")), flush=True)
        finally:
            server.stop(signal.SIGQUIT)
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
