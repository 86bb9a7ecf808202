"""What the tests have in common: the program, made recordings, real ones."""

import functools
import json
import os
import pathlib
import shutil
import struct
import subprocess
import tempfile
import unittest
import zipfile

PROGRAM = os.environ["SIXPOINT_PROGRAM"]
SOURCE = pathlib.Path(os.environ["SIXPOINT_SOURCE"])
SHARED = pathlib.Path(os.environ["SIXPOINT_SHARED"])


def program(*arguments, expected=(0,)):
    """Run the program; its standard output."""
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode in expected, (arguments, done.returncode, done.stderr)
    return done.stdout


def program_json(*arguments, expected=(0,)):
    return json.loads(program(*arguments, "--json", expected=expected))


def real(name):
    """A real recording; the test is skipped where it is not there."""
    path = SHARED / "data" / name
    if not path.exists():
        raise unittest.SkipTest(f"SKIPPED, NOT PASSED: {name} is not in {SHARED / 'data'}")
    return path


@functools.cache
def simulated(seed=1, firmware="1.5.0"):
    """A recording made by the program: tests/docs/scenario.json, of an affected unit."""
    folder = pathlib.Path(tempfile.mkdtemp(prefix="made", dir=os.environ["HOME"]))
    scenario = json.loads((SOURCE / "tests/docs/scenario.json").read_text())
    scenario["seed"] = seed
    scenario["unit"]["firmware"] = firmware
    (folder / "s.json").write_text(json.dumps(scenario))
    path = folder / f"day{seed}.gt3x"
    program("simulate", "--scenario", folder / "s.json", "-o", path)
    return path


def record(kind, time, payload):
    head = struct.pack("<BBLH", 0x1E, kind, time, len(payload)) + payload
    checksum = 0
    for byte in head:
        checksum ^= byte
    return head + bytes([~checksum & 0xFF])


def packed(samples):
    """12 bits a value, in the order Y X Z."""
    bits = "".join(f"{value & 0xFFF:012b}" for x, y, z in samples for value in (y, x, z))
    bits += "0" * (-len(bits) % 8)
    return bytes(int(bits[at : at + 8], 2) for at in range(0, len(bits), 8))


START = 1_428_588_240
INFO = (
    "Serial Number: MOS2A45130450\r\nFirmware: 1.5.0\r\nSample Rate: 30\r\n"
    "Start Date: 635641850400000000\r\nAcceleration Scale: 256.0\r\n"
    "Acceleration Min: -8.0\r\nAcceleration Max: 8.0\r\nTimeZone: -04:00:00\r\n"
)


def samples_of(second):
    return [(second + i, -second, 256 + i) for i in range(30)]


def write_recording(path, log, info=INFO, method=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr("log.bin", log)
        archive.writestr("info.txt", info)
    return path


def small(folder, seconds=(0, 1, 2, 5, 6)):
    """Some seconds; the others between them are missing."""
    log = b"".join(record(0, START + second, packed(samples_of(second))) for second in seconds)
    return write_recording(pathlib.Path(folder) / "small.gt3x", log)


def many_gaps(folder):
    """Every other second is missing: a gap more than are listed."""
    payload = packed(samples_of(0))
    log = b"".join(record(0, START + 2 * second, payload) for second in range(10_002))
    return write_recording(pathlib.Path(folder) / "gaps.gt3x", log)


class InFolder(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
