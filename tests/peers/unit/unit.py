#!/usr/bin/env python3
"""The unit platen@ under a real systemd: a Debian machine boots in QEMU with the packages installed.

    apt-get install qemu-system-x86 mmdebstrap cpio
    bash .ci/package && python3 tests/peers/unit/unit.py            (--suite trixie for Debian 13)

The machine is Debian's minimal base, its cloud kernel and our packages with what they depend on, all in memory: no disk, no network. `inside.sh`
runs in it and prints figures; they are judged here. Needs root, for mmdebstrap. The processor is emulated, so that it runs anywhere: 3 minutes on two idle cores.
It is one without AVX, as small industrial computers have: libraries take other ways there, and QEMU emulates AVX so slowly that a measurement of 0.4 s
takes 35 s, 7 s without.
"""

import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
PACKAGES = ROOT / "target/debian"

PLANT = """[plant]
name = "unit"
[press]
name = "press"
press_id = 3
[press.link]
type = "tcp"
host = "127.0.0.1"
port = 15020
unit = 1
[press.timeouts]
scan_ms = 120000
evaluate_ms = 120000
[scanner]
plugin = "simulated"
[scanner.options]
cell = "127.0.0.1:15021"
step_deg = 0.1
[frame]
u_axis = [1.0, 0.0, 0.0]
[plates]
folder = "/usr/share/doc/platen/config/plates"
[flattening]
plugin = "harmonic"
[[comparison]]
plugin = "template"
[output]
folder = "/var/lib/platen/{name}"
"""
PRESS_UNIT = """[Service]
ExecStart=/usr/bin/platen-sim press /etc/platen-sim-press.toml
"""
VERIFY_UNIT = """[Unit]
After=multi-user.target
[Service]
Type=oneshot
ExecStart=/root/inside.sh
StandardOutput=file:/dev/ttyS0
TimeoutStartSec=600
[Install]
WantedBy=multi-user.target
"""

# Name of a figure -> what it must be, with the reason in words. Times are those of an emulated processor: they are there to be read,
# and only what never ends fails.
WANTED = {
    "start_exit": (lambda v: v == "0", "systemctl start waits for READY"),
    "ready_s": (lambda v: float(v) < 20, "from start to READY"),
    "measured": (lambda v: int(v) >= 1, "strokes are measured under the release's kernel"),
    "not_measured": (lambda v: v == "0", "and none is not"),
    "harmonic": (lambda v: v == "0", "a plate is measured by the flattening harmonic"),
    "abf": (lambda v: v == "0", "by abf"),
    "elastic": (lambda v: v == "0", "by elastic"),
    "ready_after_kill_s": (lambda v: float(v) < 30, "READY again after kill -9"),
    "ready_after_stop_s": (lambda v: float(v) < 60, "READY again after SIGSTOP, by the watchdog"),
    "watchdog_lines": (lambda v: int(v) >= 1, "the journal names the watchdog"),
    "same_host_without_press": (lambda v: v == "yes", "a press that is off restarts nothing"),
    "same_host_after_upgrade": (lambda v: v == "yes", "an upgrade restarts nothing"),
    "bad_start_exit": (lambda v: v != "0", "a wrong plant file is not started"),
    "bad_state": (lambda v: v == "failed", "nor tried again until someone acts"),
    "bad_lines": (lambda v: v == "1", "one line in the journal"),
    "bad_says": (lambda v: "bad.toml:9:" in v, "with file and line"),
    "stop_s": (lambda v: float(v) < 25, "systemctl stop ends the host while a stroke is measured"),
    "stop_result": (lambda v: v == "success", "in order"),
    "state_without_drop_in": (lambda v: v == '"offline"', "an address that no drop-in allows is out of reach"),
    "state_with_drop_in": (lambda v: v not in ("", '"offline"'), "`platen systemd` allows the plant's own"),
    "exposure": (lambda v: float(v) <= 1.6, "systemd-analyze security"),
    "owner": (lambda v: v == "platen:750", "owner and mode of the record's folder"),
    "purge_exit": (lambda v: v == "0", "dpkg --purge"),
    "active_after_purge": (lambda v: v != "active", "removing the package ends the hosts"),
    "record_after_purge": (lambda v: int(v) >= 1, "purging leaves the record"),
    "done": (lambda v: v == "yes", "inside.sh came to its end"),
}


def machine(suite, folder):
    """Kernel and root file system (cpio) of a Debian machine with the packages installed by apt."""
    files = folder / "files"
    write = {
        "etc/platen/p1.toml": PLANT.format(name="p1"),
        # Line 9: the port is no number.
        "etc/platen/bad.toml": PLANT.format(name="bad").replace("port = 15020", 'port = "one"'),
        "etc/platen-sim-press.toml": (ROOT / "config/sim-press.toml").read_text().replace("control_port", 'bind = "0.0.0.0"\ncontrol_port'),
        "etc/systemd/system/platen-sim-press.service": PRESS_UNIT,
        "etc/systemd/system/verify.service": VERIFY_UNIT,
        "root/inside.sh": (HERE / "inside.sh").read_text(),
    }
    for name, text in write.items():
        path = files / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (files / "root/inside.sh").chmod(0o755)
    debs = sorted(PACKAGES.glob("platen_*.deb")) + sorted(PACKAGES.glob("platen-sim_*.deb"))
    assert len(debs) == 2, f"{PACKAGES} holds not one platen and one platen-sim: bash .ci/package builds them"
    root = folder / "root"
    hooks = [f"copy-in {' '.join(map(str, debs))} /root",
             'chroot "$1" sh -c "apt-get install -y --no-install-recommends /root/*.deb"',
             f'cp -rT {files} "$1"',
             'chroot "$1" systemctl enable verify.service']
    run(["mmdebstrap", "--mode=root", "--variant=minbase", "--format=directory", "--quiet",
         "--include=systemd-sysv,udev,dbus,linux-image-cloud-amd64,iproute2",
         "--dpkgopt=path-exclude=/usr/share/man/*", "--dpkgopt=path-exclude=/usr/share/locale/*",
         *(f"--customize-hook={hook}" for hook in hooks), suite, str(root), "http://deb.debian.org/debian"])
    kernel = next((root / "boot").glob("vmlinuz-*"))
    kernel = kernel.rename(folder / "kernel")
    for initrd in (root / "boot").glob("initrd*"):
        initrd.unlink()
    image = folder / "root.cpio"
    run(["sh", "-c", f"cd {root} && ln -sf sbin/init init && find . -xdev -print0 | cpio --null --create --format=newc --quiet > {image}"])
    return kernel, image


def run(command):
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, f"{' '.join(command[:2])} ended with {done.returncode}:\n{done.stdout[-4000:]}"


def boot(kernel, image):
    """What the machine printed on its serial line, until it powered itself off."""
    options = "console=ttyS0 quiet loglevel=3 rdinit=/init panic=-1 systemd.mask=serial-getty@ttyS0.service systemd.show_status=no"
    qemu = ["qemu-system-x86_64", "-accel", "tcg,thread=multi", "-cpu", "Nehalem", "-smp", "2", "-m", "3072", "-nographic", "-no-reboot",
            "-nic", "none", "-kernel", str(kernel), "-initrd", str(image), "-append", options]
    try:
        return subprocess.run(qemu, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=1200).stdout.decode(errors="replace")
    except subprocess.TimeoutExpired as late:
        return (late.stdout or b"").decode(errors="replace") + "\nthe machine did not end within 20 minutes"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--suite", default="bookworm", help="Debian release: bookworm or trixie")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="platen-unit-", dir="/var/tmp") as folder:
        output = boot(*machine(options.suite, pathlib.Path(folder)))
    figures = {}
    for name, value in re.findall(r"figure (\w+) ?(.*)", output):
        figures[name] = value.strip()
    wrong = 0
    print(f"Debian {figures.get('debian')}, systemd {figures.get('systemd')}")
    for name, (holds, reason) in WANTED.items():
        value = figures.get(name)
        try:
            good = value is not None and holds(value)
        except ValueError:
            good = False
        wrong += not good
        print(f"{'ok   ' if good else 'WRONG'} {reason}: {name} {value}")
    if wrong:
        print(output[-8000:], file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
