#!/usr/bin/env python3
"""Whether forwarding moves the press side: trigger to BUSY of one host, with and without `platen forward` beside it, in turn.

    python3 tests/peers/forward/press_side.py --pairs 20 --strokes 50          (packages: those of forward.py)

One press and one host run through, 14 strokes a plate with a rest of 150 ms between them; the forwarder has the priority of its unit and shares the host's
disk. The servers stand for other computers: they get what processor time is left, and their files lie in memory. Blocks of strokes alternate: forwarder off, on, on, off; a block with it begins with the backlog of the block before, to PostgreSQL and
mosquitto. Each stroke's time is the one that the host logs. Printed: median, 95 % and 99 % of both, their ratio, and its 95 % interval by drawing pairs of blocks anew, so that
a slow drift of the machine falls out; the machine's load beside it. The figures judge nothing. Exit code 1: a stroke is missing at a sink.
"""
import argparse, os, random, re, tempfile
from pathlib import Path

from forward import SITE, Site
from servers import wait

LINE = re.compile(r"trigger_to_busy_ms=(?:Some\()?([\d.]+)")


def times(plant):
    """Trigger to BUSY of each stroke so far, milliseconds."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", (plant.folder / "host.log").read_text())
    return [float(found) for found in LINE.findall(plain)]


def give_way(process):
    """The process and its children to come get the time that nobody else needs; so does its session, where it has one of its own."""
    os.setpriority(os.PRIO_PROCESS, process, 19)
    group = Path(f"/proc/{process}/autogroup")
    if group.exists() and os.getsid(process) != os.getsid(0):
        group.write_text("19")


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
            plant = site.press("press-1", "postgresql", "mqtt", strokes=14, parts=wanted // 14 + 3, between_ms=150)
            site.prepare()
            give_way(int((site.postgresql.data / "postmaster.pid").read_text().split()[0]))
            give_way(site.mosquitto.process.pid)
            plant.start_press()
            plant.start_host()
            wait("the first strokes", lambda: len(times(plant)) >= 5, 120)
            for k in range(options.pairs):
                blocks = {}
                for on in ((False, True), (True, False))[k % 2]:
                    if on:
                        plant.start_forwarder()
                    before = len(times(plant))
                    wait("a block of strokes", lambda: len(times(plant)) >= before + options.strokes, 60 * options.strokes)
                    blocks[on] = times(plant)[before:before + options.strokes]
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
