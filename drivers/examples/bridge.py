#!/usr/bin/env python3
"""A scan bridge in Python, of the standard library alone: scans of a level floor by the scan bridge protocol 1.0.

    python3 bridge.py 127.0.0.1:7040
    platen bridge check 127.0.0.1:7040

To be changed into one for a device: `measure` is where it is. Section numbers are those of drivers/faro-stream/PROTOCOL.md.
"""

import argparse
import json
import math
import pickle
import select
import socket
import struct
import tempfile
import threading
import time
from pathlib import Path

HELLO, CAPABILITIES, CONFIGURE, CONFIGURED, START, ABORT, RESUME = range(0x8001, 0x8008)
HEARTBEAT, STATUS, ERROR, SCAN_BEGIN, COLUMN, SCAN_END = 0x0008, 0x0009, 0x800A, 0x8010, 0x8011, 0x8012
CRITICAL = 0x8000
LARGEST = 1 << 20
LEASE_S = 5.0
DIVISORS = (8, 16, 32)


def crc32c_table():
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
        yield byte


TABLE = list(crc32c_table())


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc = TABLE[(crc ^ byte) & 0xFF] ^ crc >> 8
    return crc ^ 0xFFFFFFFF


class Hangup(Exception):
    """The connection has to end."""


class Refused(Exception):
    """An Error of the protocol (section 7), after which the connection ends or not."""

    def __init__(self, code, text, ends=False, **more):
        super().__init__(text)
        self.ends = ends
        self.message = {"code": code, "text": text, **more}


def plan(settings):
    """The settings that will be used, and the duration (section 3)."""
    if settings.get("divisor") not in DIVISORS or settings.get("rate_kpts") != 122:
        raise Refused("config", f"divisor {DIVISORS} and rate_kpts 122 are possible")
    columns = 40 * 32 // settings["divisor"]
    return {"divisor": settings["divisor"], "rate_kpts": 122, "compression": 1, "duration_s": 0.01 * columns, "altered": []}


def measure(settings, job, progress, aborted):
    """One scan: ScanBegin, payloads of the columns by number, outcome. The device belongs here."""
    n = 40 * 32 // settings["divisor"]
    begin = {
        "job": job, "rows": n, "columns": n, "azimuth_start": 0.2, "azimuth_step": -0.4 / n,
        "elevation_start": -0.3, "elevation_step": -0.4 / n, "values": "range", "range_unit_m": 1e-6, "intensity": [0, 2047],
        "instrument": "example floor", "acquired_unix_s": time.time(), "range_error_m": 0.002, "simulated": True, "altered": [],
    }
    columns = []
    for column in range(n):
        if aborted():
            return begin, columns, "aborted"
        time.sleep(0.01)
        elevations = [begin["elevation_start"] + row * begin["elevation_step"] for row in range(n)]
        ranges = [-2.0 / math.sin(elevation) for elevation in elevations]
        valid = [distance < 8.0 for distance in ranges]
        bits = "".join("01"[it] for it in valid).ljust(-(-n // 8) * 8, "0")
        bitmap = bytes(int(bits[at:at + 8], 2) for at in range(0, len(bits), 8))
        records = b"".join(struct.pack("<IH", round(it * 1e6), 900) for it, seen in zip(ranges, valid) if seen)
        columns.append(struct.pack("<IIIIQ", column, 0, n, 0, time.monotonic_ns()) + bitmap + records)
        progress((column + 1) / n)
    return begin, columns, "complete"


def encode(kind, scan, number, payload):
    """A frame (section 1)."""
    head = struct.pack("<4sBBHI", b"PSB1", 1, 0, kind, len(payload)) + bytes(4) + struct.pack("<QII", number, scan, 0)
    head = head[:12] + struct.pack("<I", crc32c(head[:12] + head[16:])) + head[16:]
    return head + payload + struct.pack("<I", crc32c(payload))


def answer_datagrams(server):
    """Lets itself be found (section 8)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(server.getsockname())
        while True:
            asked, sender = found.recvfrom(2048)
            hello = asked[32:-4]
            if asked == encode(HELLO, 0, 0, hello) and b'"monitor"' in hello:
                found.sendto(encode(CAPABILITIES, 0, 0, json.dumps(CAPABLE).encode()), sender)


class Scan:
    """A scan, kept on disk so that it can be resumed (section 6)."""

    def __init__(self, job, number):
        self.job, self.number = job, number
        self.begin, self.columns, self.end, self.failed = None, [], None, None
        self.abort = threading.Event()

    def finish(self, columns, outcome):
        crcs = b"".join(struct.pack("<I", crc32c(column)) for column in columns)
        points = sum(bin(int.from_bytes(column[24:24 + -(-self.begin["rows"] // 8)], "big")).count("1") for column in columns)
        self.columns = columns
        self.end = {"outcome": outcome, "columns": len(columns), "points": points, "digest": crc32c(crcs)}


class Bridge:
    """What all connections share: the scanner, its scans, the lease."""

    def __init__(self, spool):
        self.lock = threading.Lock()
        self.spool = Path(spool)
        self.running, self.progress = None, 0.0
        self.lease = None  # client, connection, time of its last frame

    def take_lease(self, client, connection):
        with self.lock:
            if self.lease and self.lease[0] != client:
                left = self.lease[2] + LEASE_S - time.monotonic()
                if left > 0:
                    raise Refused("busy", f"held by {self.lease[0]}", retry_ms=math.ceil(1000 * left))
            if self.lease and self.lease[1] is not connection:
                self.lease[1].replaced = True
            self.lease = (client, connection, time.monotonic())

    def renew_lease(self, connection):
        with self.lock:
            if self.lease and self.lease[1] is connection:
                self.lease = (*self.lease[:2], time.monotonic())

    def find(self, job):
        if self.running and self.running.job == job:
            return self.running
        for file in self.spool.glob("*.scan"):
            scan = pickle.loads(file.read_bytes())
            if scan["job"] == job:
                found = Scan(job, scan["number"])
                found.begin, found.columns, found.end = scan["begin"], scan["columns"], scan["end"]
                return found
        return None

    def start(self, request):
        job = request.get("job")
        if not isinstance(job, str):
            raise Refused("config", "Start names no job")
        settings = plan(request)
        with self.lock:
            found = self.find(job)
            if found:
                return found
            if self.running and not self.running.end:
                raise Refused("busy", f"scanning for job {self.running.job}")
            # From the clock: no number twice, also after a restart.
            self.running = Scan(job, int(time.time() * 10) & 0x7FFFFFFF)
            threading.Thread(target=self.scan, args=(self.running, settings), daemon=True).start()
            return self.running

    def scan(self, scan, settings):
        self.progress = 0.0
        begin, columns, outcome = measure(settings, scan.job, self.tell, scan.abort.is_set)
        scan.begin = begin
        scan.finish(columns, outcome)
        kept = {"job": scan.job, "number": scan.number, "begin": begin, "columns": scan.columns, "end": scan.end}
        (self.spool / f"{scan.number}.scan").write_bytes(pickle.dumps(kept))
        for old in sorted(self.spool.glob("*.scan"), key=lambda file: file.stat().st_mtime)[:-KEPT]:
            old.unlink()

    def tell(self, progress):
        self.progress = progress

    def status(self):
        scanning = self.running and not self.running.end
        return {"state": "scanning" if scanning else "ready", "progress": self.progress if scanning else 0.0,
                "time_ns": time.monotonic_ns(), "synced": False}


KEPT = 5
CAPABLE = {
    "version": [1, 0], "model": "example floor", "serial": "1", "firmware": "1", "live": False,
    "modes": [{"divisor": it, "rate_kpts": 122} for it in DIVISORS], "max_rows": 160, "max_columns": 160, "faces": 1,
    "kept_scans": KEPT, "clock": "monotonic", "clock_synced": False,
}


class Connection:
    """One client. Between two columns it looks for commands (section 7)."""

    def __init__(self, bridge, stream):
        self.bridge, self.stream, self.held = bridge, stream, b""
        self.sent = self.received = 0
        self.role, self.replaced, self.status_due = None, False, 0.0
        self.scan, self.wanted = None, None

    def serve(self):
        try:
            while not self.replaced:
                busy = self.scan is not None and self.scan.end is not None
                frame = self.read(0.0 if busy else 0.05)
                if frame:
                    self.command(*frame)
                if self.role and time.monotonic() >= self.status_due:
                    self.send(STATUS, 0, self.bridge.status())
                    self.status_due = time.monotonic() + 0.9
                self.send_scan()
        except (Hangup, OSError):
            pass
        self.stream.close()

    def read(self, wait):
        """The next frame (section 1), or None."""
        if len(self.held) < 36 or len(self.held) < 36 + struct.unpack_from("<I", self.held, 8)[0]:
            if not select.select([self.stream], [], [], wait)[0]:
                return None
            data = self.stream.recv(65536)
            if not data:
                raise Hangup
            self.held += data
        if len(self.held) < 32:
            return None
        magic, major, _, kind, length, crc, number, scan = struct.unpack_from("<4sBBHIIQI", self.held)
        if (magic, major, number) != (b"PSB1", 1, self.received) or length > LARGEST or crc != crc32c(self.held[:12] + self.held[16:32]):
            raise Hangup
        if len(self.held) < 36 + length:
            return None
        payload, self.held = self.held[32:32 + length], self.held[32 + length:]
        check, self.held = struct.unpack_from("<I", self.held)[0], self.held[4:]
        if check != crc32c(payload):
            raise Hangup
        self.received += 1
        self.bridge.renew_lease(self)
        return kind, scan, payload

    def send(self, kind, scan, message):
        payload = message if isinstance(message, bytes) else json.dumps(message).encode()
        self.stream.sendall(encode(kind, scan, self.sent, payload))
        self.sent += 1

    def command(self, kind, scan, payload):
        if kind == HEARTBEAT or self.role and not kind & CRITICAL:
            return
        try:
            known = {HELLO: self.hello, CONFIGURE: self.configure, START: self.start, RESUME: self.resume, ABORT: self.abort}
            if kind not in known or (kind == HELLO) == bool(self.role):
                raise Refused("unknown_type", f"{kind:#06x} is not allowed here", ends=True)
            if self.role == "monitor":
                raise Refused("denied", "a monitor may not send commands")
            try:
                message = json.loads(payload)
            except ValueError:
                message = None
            if not isinstance(message, dict):
                raise Refused("config", "the payload is no JSON object", ends=True)
            known[kind](scan, message)
        except Refused as error:
            self.send(ERROR, scan, error.message)
            if kind == HELLO or error.ends:
                raise Hangup from None

    def hello(self, _, message):
        versions = message.get("versions")
        if not (isinstance(versions, list) and len(versions) == 2):
            raise Refused("config", "Hello names no versions")
        if versions[0] > [1, 0] or versions[1] < [1, 0]:
            raise Refused("version", "this bridge supports version 1.0")
        role = message.get("role")
        if role == "controller":
            self.bridge.take_lease(str(message.get("client")), self)
        self.role = role
        self.status_due = time.monotonic() + 0.9
        self.send(CAPABILITIES, 0, CAPABLE)

    def configure(self, _, message):
        self.send(CONFIGURED, 0, plan(message))

    def start(self, _, message):
        self.scan, self.wanted = self.bridge.start(message), None

    def resume(self, number, message):
        with self.bridge.lock:
            scan = self.bridge.find(message.get("job"))
        if not scan or scan.number != number:
            raise Refused("gone", "this bridge has no such scan")
        runs = message.get("missing", [])
        self.scan, self.wanted = scan, [column for first, last in runs for column in range(first, last + 1)]

    def abort(self, _, message):
        running = self.bridge.running
        if running and running.job == message.get("job"):
            running.abort.set()

    def send_scan(self):
        """Sends ScanBegin, then 16 columns at a time, then ScanEnd, once the scan is finished."""
        scan = self.scan
        if scan is None or scan.end is None:
            return
        if not isinstance(self.wanted, tuple):
            wanted = range(len(scan.columns)) if self.wanted is None else self.wanted
            self.wanted = tuple(it for it in wanted if it < len(scan.columns))
            self.send(SCAN_BEGIN, scan.number, scan.begin)
        for column in self.wanted[:16]:
            self.send(COLUMN, scan.number, scan.columns[column])
        self.wanted = self.wanted[16:]
        if not self.wanted:
            self.send(SCAN_END, scan.number, scan.end)
            self.scan = None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("address", help="HOST:PORT to serve; loopback unless the driver runs elsewhere, port 0: of the system's choice")
    parser.add_argument("--spool", help="folder of the last scans, made when missing; a temporary one without")
    options = parser.parse_args()
    host, port = options.address.rsplit(":", 1)
    with tempfile.TemporaryDirectory() as folder:
        spool = Path(options.spool or folder)
        spool.mkdir(parents=True, exist_ok=True)
        bridge = Bridge(spool)
        with socket.create_server((host, int(port))) as server:
            threading.Thread(target=answer_datagrams, args=(server,), daemon=True).start()
            print(json.dumps({"bridge": "%s:%d" % server.getsockname()[:2]}), flush=True)
            while True:
                stream, _ = server.accept()
                stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                threading.Thread(target=Connection(bridge, stream).serve, daemon=True).start()


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
