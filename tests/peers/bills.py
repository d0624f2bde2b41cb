#!/usr/bin/env python3
"""The bills of materials in the Debian packages against the programs and against Cargo.lock.

    bash .ci/package && python3 tests/peers/bills.py            (binutils, dpkg)

Every program and plugin in a package has a bill; it names exactly the crates that the file itself lists (section .dep-v0, read by objcopy and zlib);
every crate stands in Cargo.lock in that version; and every crate that Cargo says is needed to run the package's own crate is in a bill.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib
import zlib

ROOT = pathlib.Path(__file__).resolve().parents[2]


def listed(file, folder):
    """Crates in a program, from the list that it carries."""
    section = folder / "section"
    subprocess.run(["objcopy", "--dump-section", f".dep-v0={section}", file, folder / "copy"], check=True)
    packages = json.loads(zlib.decompress(section.read_bytes()))["packages"]
    return {(p["name"], p["version"]) for p in packages if p.get("kind") != "build"}


def billed(bill):
    """Crates in a bill, the described one among them."""
    document = json.loads(bill.read_text())
    assert document["bomFormat"] == "CycloneDX", bill
    components = [*document["components"], document["metadata"]["component"]]
    return {(c["name"], c["version"]) for c in components}


def needed(crate):
    """Crates that Cargo links for a crate."""
    tree = subprocess.run(["cargo", "tree", "--locked", "--package", crate, "--edges", "normal,no-proc-macro", "--prefix", "none"],
                          cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    return {(words[0], words[1].removeprefix("v")) for words in (line.split() for line in tree.splitlines()) if words}


def main():
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text())
    locked = {(p["name"], p["version"]) for p in lock["package"]}
    wrong = []
    for package, crate in ("platen", "platen"), ("platen-sim", "platen-sim"):
        deb, = (ROOT / "target/debian").glob(f"{package}_*.deb")
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            subprocess.run(["dpkg-deb", "-x", deb, folder / "files"], check=True)
            files = [f for f in (folder / "files/usr").rglob("*") if f.is_file() and f.read_bytes()[:4] == b"\x7fELF"]
            bills = {b.name.removesuffix(".cdx.json"): billed(b) for b in (folder / "files").rglob("*.cdx.json")}
            if set(bills) != {f.name for f in files}:
                wrong.append(f"{package}: bills of {sorted(bills)} for {sorted(f.name for f in files)}")
            for file in files:
                bill, own = bills.get(file.name, set()), listed(file, folder)
                if own - bill:
                    wrong.append(f"{file.name}: not in its bill: {sorted(own - bill)}")
                if bill - locked:
                    wrong.append(f"{file.name}: not in Cargo.lock: {sorted(bill - locked)}")
            missing = needed(crate) - set().union(*bills.values())
            if missing:
                wrong.append(f"{package}: needed, but in no bill: {sorted(missing)}")
            print(f"{package}: {len(files)} programs and plugins, {len(set().union(*bills.values()))} crates, each in Cargo.lock")
    print("\n".join(wrong), file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
