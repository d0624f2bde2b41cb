#!/usr/bin/env python3
"""Whether forwarding moves the press side: trigger to BUSY of one host, with and without `platen forward` beside it, in turn.

    python3 tests/peers/forward/press_side.py --pairs 20 --strokes 50          (packages: those of forward.py)

One press and one host run through, 14 strokes a plate with a rest of 100 ms between them; the forwarder has the priority of its unit and shares the host's
disk. The servers stand for other computers: they get what processor time nobody else needs, and their files lie in memory. Blocks of strokes alternate:
forwarder off, on, on, off; a block with it begins with the backlog of the block before, to PostgreSQL and mosquitto. Each stroke's time is the one that the
host logs; this program looks for it once a second. Printed: median, 95 % and 99 % of both, their ratio, and its 95 % interval by drawing pairs of blocks anew,
so that a slow drift of the machine falls out; the machine's load beside it. The figures judge nothing. Exit code 1: a stroke is missing at a sink.
"""
import argparse, os, random, re, tempfile
from pathlib import Path

from forward import SITE, Site
from servers import wait

LINE = re.compile(r"trigger_to_busy_ms=(?:Some\()?([\d.]+)")
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
# Groups of the processor's scheduler: cgroup v1, else v2.
CPU = next(path for path in (Path("/sys/fs/cgroup/cpu"), Path("/sys/fs/cgroup")) if path.exists())


class Times:
    """Trigger to BUSY of each stroke so far, milliseconds, from a host's log as it grows."""

    def __init__(self, plant):
        self.log, self.found = open(plant.folder / "host.log"), []

    def __len__(self):
        # Half a line waits for the rest of it.
        while (line := self.log.readline()).endswith("\n"):
            self.found += [float(it) for it in LINE.findall(COLOUR.sub("", line))]
        self.log.seek(self.log.tell() - len(line.encode()))
        return len(self.found)

    def reach(self, count, limit):
        wait("strokes", lambda: len(self) >= count, limit, every=1.0)


def give_way(*processes):
    """These processes, and the children to come, get the time that nobody else needs, as services of CPUWeight=idle do."""
    control = CPU / "cgroup.subtree_control"
    if control.exists():
        control.write_text("+cpu")
    group = CPU / "platen-idle"
    group.mkdir(exist_ok=True)
    (group / "cpu.idle").write_text("1")
    for process in processes:
        (group / "cgroup.procs").write_text(str(process))


def share(values, part):
    return sorted(values)[min(len(values) - 1, int(part * len(values)))]


def ratio(pairs, part):
    of = lambda which: share([it for pair in pairs for it in pair[which]], part)
    return of(True) / of(False)


def told(pairs, chance):
    for part, name in [(0.5, "median"), (0.95, "95 %"), (0.99, "99 %")]:
        off, on = (share([it for pair in pairs for it in pair[which]], part) for which in (False, True))
        drawn = sorted(ratio(chance.choices(pairs, k=len(pairs)), part) for _ in range(2000))
        print(f"trigger to busy, {name}: {off:.2f} ms without, {on:.2f} ms with the forwarder; ratio {on / off:.3f}, 95 %: {drawn[50]:.3f} to {drawn[1949]:.3f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--strokes", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    wanted = 2 * options.pairs * options.strokes
    loads, pairs = [], []
    os.environ["PLATEN_LOG"] = "warn,platen_press=info"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, tempfile.TemporaryDirectory(ignore_cleanup_errors=True, dir="/dev/shm") as memory:
        os.chmod(memory, 0o755)
        site = Site(folder, servers=memory)
        try:
            plant = site.press("press-1", "postgresql", "mqtt", strokes=14, parts=wanted // 5, between_ms=100, step_deg=0.15)
            site.prepare()
            postmaster = int((site.postgresql.data / "postmaster.pid").read_text().split()[0])
            give_way(postmaster, site.mosquitto.process.pid)
            plant.start_press()
            plant.start_host()
            times = Times(plant)
            times.reach(5, 120)
            for k in range(options.pairs):
                blocks = {}
                for on in ((False, True), (True, False))[k % 2]:
                    if on:
                        plant.start_forwarder()
                    before = len(times)
                    times.reach(before + options.strokes, 60 * options.strokes)
                    blocks[on] = times.found[before:before + options.strokes]
                    loads.append(os.getloadavg()[0])
                    if on:
                        plant.end("forwarder")
                pairs.append(blocks)
            plant.end("host")
            assert all(it["backlog"] == 0 and it["refused"] == 0 for it in plant.flush())
            recorded = len(plant.strokes())
            assert site.postgresql.query("SELECT count(*) FROM platen.stroke WHERE site = %s", SITE) == [(recorded,)] and recorded >= wanted
        finally:
            site.end()
    print(f"{wanted} strokes in {options.pairs} pairs of blocks; load of the machine {min(loads):.1f} to {max(loads):.1f} on {os.cpu_count()} processors")
    told(pairs, random.Random(options.seed))


if __name__ == "__main__":
    main()
