#!/usr/bin/env python3
"""A press on pymodbus with its own stroke logic: drives a host through strokes and judges it from the press's side.

    pip install pymodbus==3.16.1            (RTU besides: pyserial)
    python3 pymodbus_press.py --strokes 20
    python3 pymodbus_press.py --serial /dev/pts/7 --baud 115200 --parity N

The first line on stdout is {"port": N}; the last is a summary with the words of every result. The exit code is 0
when every stroke got its result and nothing was wrong, else 1. Registers: plate press - host, version 1, P block at
0, H block at 100, unit 1.
"""

import argparse
import asyncio
import json
import random
import sys
import time

from pymodbus import FramerType
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

P, H, SIZE = 0, 100, 200
ENABLE, TRIGGER, ACK, CLEAR, PART_END, RESCAN, BASELINE = 1, 2, 4, 32, 128, 256, 512
READY, BUSY, VALID, PASS, FAIL, SIMULATED, NOT_MEASURED, CANNOT_TELL = 1, 2, 4, 8, 16, 512, 4096, 8192
HOST_DEAD_S = 2.0


def crc16(words):
    """CRC-16/MODBUS, each word high byte first."""
    crc = 0xFFFF
    for byte in (b for w in words for b in (w >> 8, w & 255)):
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return crc


class Press:
    def __init__(self, options):
        self.options = options
        self.words = [0] * SIZE
        self.random = random.Random(options.seed)
        self.faults = []
        self.results = []
        self.read_p = self.read_h = False
        self.counts = {"strokes": 0, "reads": 0, "writes": 0, "writes_outside": 0, "writes_before_sync": 0,
                       "duplicates": 0, "owners": []}
        self.published = {}
        self.host_beat_at = None
        p = self.words
        p[P + 0], p[P + 4], p[P + 5], p[P + 7] = 1, self.random.randrange(1, 65536), options.recipe, options.press_id
        p[P + 6], p[P + 9], p[P + 19] = 2, 1, 3500
        p[P + 10:P + 12] = [0x4131, 0x3700]  # "A17"
        p[P + 2] = ENABLE | CLEAR
        self.set_number(options.first - 1)

    # The wire ------------------------------------------------------------------------------------------------

    async def action(self, _function, start, address, count, registers, values):
        if values is None:
            self.counts["reads"] += 1
            self.read_p |= address < P + 32
            self.read_h |= address + count > H and address < H + 64
        else:
            self.counts["writes"] += 1
            self.counts["writes_outside"] += not (H <= address and address + len(values) <= H + 64)
            self.counts["writes_before_sync"] += not (self.read_p and self.read_h)
            for i, value in enumerate(values):
                self.words[address + i] = int(value)
            self.look()
        for i in range(min(len(registers), SIZE - start)):  # pymodbus keeps one register more than the table has
            registers[i] = self.words[start + i]
        return None

    def look(self):
        """After every write: heartbeat, owner, a second publication of the same stroke."""
        h = self.words[H:H + 64]
        if getattr(self, "beat", None) != h[1]:
            self.beat, self.host_beat_at = h[1], time.monotonic()
        if h[49] and h[49] not in self.counts["owners"]:
            self.counts["owners"].append(h[49])
        if h[2] & VALID and h[8] == h[53]:
            seq = self.published.setdefault((h[5], h[4], h[61]), h[8])
            if seq != h[8]:
                self.counts["duplicates"] += 1
                self.published[(h[5], h[4], h[61])] = h[8]

    # The program ---------------------------------------------------------------------------------------------

    def set_number(self, number):
        self.number = number
        self.words[P + 31] = self.words[P + 3] = number

    def control(self, on=0, off=0):
        self.words[P + 2] = (self.words[P + 2] | on) & ~off

    def host_alive(self):
        return self.host_beat_at is not None and time.monotonic() - self.host_beat_at < HOST_DEAD_S

    async def until(self, what, condition, limit_s):
        deadline = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError(f"stroke {self.number}: {what} did not come within {limit_s} s")
            await asyncio.sleep(0.002)

    async def heartbeat(self):
        while True:
            self.words[P + 1] = (self.words[P + 1] + 1) & 0xFFFF
            await asyncio.sleep(0.25)

    async def part(self):
        """One part: an optional baseline, then the strokes."""
        h = lambda i: self.words[H + i]
        await self.until("ready", lambda: self.host_alive() and h(2) & READY, self.options.ready_s)
        if self.options.baseline:
            await self.measure(BASELINE)
        for _ in range(self.options.strokes):
            self.control(off=CLEAR)
            self.words[P + 6] = 3
            await asyncio.sleep(self.options.ram_s)
            self.words[P + 18] += 1
            self.words[P + 6] = 2
            self.control(on=CLEAR)
            self.counts["strokes"] += 1
            await self.measure(0)
        self.control(on=PART_END)
        await asyncio.sleep(0.6)

    async def measure(self, extra):
        h = lambda i: self.words[H + i]
        self.set_number(self.number % 65535 + 1)
        session, number, raised = self.words[P + 4], self.number, time.monotonic()
        self.control(on=TRIGGER | extra)
        await self.until("the echo", lambda: h(3) == number and h(5) == session, self.options.accept_s)
        accepted = time.monotonic()
        self.control(off=TRIGGER | extra)
        await self.until("the result", lambda: self.usable(session, number), self.options.result_s)
        words = self.words[H:H + 64]
        self.judge(words)
        self.results.append({"stroke": number, "session": session, "baseline": bool(extra), "words": words,
                             "accepted_ms": round((accepted - raised) * 1e3),
                             "result_ms": round((time.monotonic() - raised) * 1e3)})
        await asyncio.sleep(self.options.read_s)
        self.control(on=ACK)
        await self.until("valid to fall", lambda: not h(2) & VALID, self.options.accept_s)
        self.control(off=ACK)

    def usable(self, session, number):
        h = self.words[H:H + 64]
        return (h[0] == 1 and h[2] & VALID and h[4] == number and h[5] == session and h[8] == h[53]
                and h[61] == self.words[P + 29] and self.host_alive())

    def judge(self, h):
        """What a result must never be, whatever was measured."""
        check = lambda holds, sentence: None if holds else self.faults.append(f"stroke {h[4]}: {sentence}")
        status = h[2]
        check(sum(bool(status & bit) for bit in (PASS, FAIL, NOT_MEASURED, CANNOT_TELL)) == 1, f"status {status:#06x} holds not one verdict")
        check(not status & BUSY, "valid and busy at once")
        check(h[52] == crc16(h[3:52] + h[55:62]), f"check sum {h[52]:#06x}, words give {crc16(h[3:52] + h[55:62]):#06x}")
        check(h[48] == self.options.recipe, f"recipe {h[48]} echoed")
        check(bool(status & SIMULATED) == self.options.simulated, f"simulated bit in status {status:#06x}")
        signed = lambda w: w - 65536 if w & 0x8000 else w
        if h[10] != 0x8000 and h[11] != 0x8000:
            check(signed(h[10]) >= signed(h[11]), f"deviation from {signed(h[11])} to {signed(h[10])}")
        check(h[14] == 0xFFFF or h[14] <= 1000, f"{h[14]} thousandths within tolerance")
        check(h[16] == 0xFFFF or h[16] <= 1000, f"{h[16]} thousandths measured")
        if status & NOT_MEASURED:
            check(h[55] == 0xFFFF, f"not measured, yet a gap of {h[55]}")
        if status & PASS and self.options.gap_limit is not None:
            check(h[55] <= self.options.gap_limit, f"passed with a gap of {h[55]}")

    def summary(self):
        own = {"peer": "pymodbus", **self.counts, "missed_reported": self.words[H + 9], "faults": self.faults,
               "results": self.results}
        wanted = self.options.strokes + self.options.baseline
        own["passed"] = (len(self.results) == wanted and not self.faults and len(own["owners"]) <= 1
                         and not any(own[k] for k in ("writes_outside", "writes_before_sync", "duplicates",
                                                      "missed_reported")))
        return own


async def main(options):
    press = Press(options)
    device = SimDevice(id=1, simdata=[SimData(0, values=[0] * SIZE, datatype=DataType.REGISTERS)], action=press.action)
    if options.serial:
        server = ModbusSerialServer(device, framer=FramerType.RTU, port=options.serial, baudrate=options.baud,
                                    parity=options.parity)
    else:
        server = ModbusTcpServer(device, address=("127.0.0.1", options.port))
    await server.serve_forever(background=True)
    port = None if options.serial else server.transport.sockets[0].getsockname()[1]
    print(json.dumps({"port": port}), flush=True)
    beat = asyncio.create_task(press.heartbeat())
    try:
        await press.part()
    except TimeoutError as late:
        press.faults.append(str(late))
    summary = press.summary()
    print(json.dumps(summary), flush=True)
    beat.cancel()
    await server.shutdown()
    return 0 if summary["passed"] else 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--port", type=int, default=0, help="TCP port on loopback, 0: the system chooses")
    parser.add_argument("--serial", help="serial port instead of TCP")
    parser.add_argument("--baud", type=int, default=19200)
    parser.add_argument("--parity", choices="NEO", default="E", help="N on a pseudo terminal, which refuses parity")
    parser.add_argument("--strokes", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="number of the first stroke")
    parser.add_argument("--baseline", type=int, choices=(0, 1), default=1, help="1: a scan of the blank first")
    parser.add_argument("--simulated", type=int, choices=(0, 1), default=0, help="1: results must say that they are")
    parser.add_argument("--press-id", type=int, default=3)
    parser.add_argument("--recipe", type=int, default=17)
    parser.add_argument("--gap-limit", type=int, help="0.01 mm, a passed result must not exceed it")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ram-s", type=float, default=0.05, help="time of the ram's way")
    parser.add_argument("--read-s", type=float, default=0, help="time that a result stands before it is acknowledged")
    parser.add_argument("--ready-s", type=float, default=30)
    parser.add_argument("--accept-s", type=float, default=5)
    parser.add_argument("--result-s", type=float, default=60)
    sys.exit(asyncio.run(main(parser.parse_args())))
