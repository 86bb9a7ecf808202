#!/usr/bin/env python3
"""Makes the conformance suite: make.py FOLDER

Small recordings (NAME.gt3x) and beside each what a reader must make of it (NAME.json), with the rule of
docs/recordings.md that it holds. Written from the public descriptions of the formats (the vendor's of .gt3x, PKWARE's
of zip, RFC 1951 by zlib) with Python's standard library alone: it shares no code with any reader.
README.md has the form of the JSON.
"""
import json
import math
import pathlib
import struct
import sys
import zlib

START = 1_428_588_240  # 2015-04-09T14:04:00
TICKS_1970 = 621_355_968_000_000_000
ACTIVITY, BATTERY, EVENT, LUX, METADATA, PARAMETERS = 0, 2, 3, 5, 6, 21
ACTIVITY2, ACTIVITY3 = 26, 27
NAMES = {0: "ACTIVITY", 2: "BATTERY", 3: "EVENT", 5: "LUX", 6: "METADATA", 7: "TAG", 13: "CAPSENSE",
         21: "PARAMETERS", 26: "ACTIVITY2", 27: "ACTIVITY3"}


# -- samples and records

def pack12(values):
    nibbles = "".join(f"{value & 0xFFF:03x}" for value in values)
    return bytes.fromhex(nibbles + "0" * (len(nibbles) % 2))


def activity(samples):
    return pack12([value for x, y, z in samples for value in (y, x, z)])


def activity3(samples):
    return pack12([value for sample in samples for value in sample])


def activity2(samples):
    return b"".join(struct.pack("<hhh", *sample) for sample in samples)


PACKED = {ACTIVITY: activity, ACTIVITY2: activity2, ACTIVITY3: activity3}


def record(kind, time, payload):
    body = struct.pack("<BBIH", 0x1E, kind, time, len(payload)) + payload
    total = 0
    for byte in body:
        total ^= byte
    return body + bytes([~total & 0xFF])


def wave(second, rate=30, low=-2000, high=2000):
    """Samples of one second that differ from those of every other second."""
    span = high - low
    return [[low + (second * 977 + i * 61) % span, low + (second * 389 + i * 113 + 7) % span,
             low + (second * 151 + i * 29 + 500) % span] for i in range(rate)]


def second(number, kind=ACTIVITY, rate=30, samples=None, time=None):
    samples = wave(number, rate) if samples is None else samples
    return record(kind, START + number if time is None else time, PACKED[kind](samples))


def encoded(value):
    """The vendor's numbers with decimals."""
    if value == 0:
        return 0
    mantissa, exponent = math.frexp(abs(value))
    fraction = int(mantissa * 2**23)
    if value < 0:
        fraction = -fraction & 0xFFFFFF
    return fraction | (exponent & 0xFF) << 24


CONSTANTS = {"positive_lsb": [326, 287, 303], "negative_lsb": [-201, -268, -192], "zero_lsb": [61, 4, 61]}


def constants_values(constants):
    values = {}
    for first, key in ((4, "negative_lsb"), (7, "positive_lsb"), (15, "zero_lsb")):
        for axis in range(3):
            values[1, first + axis] = constants[key][axis] & 0xFFFFFFFF
    return values


def parameters(values=None, time=START - 1, constants=CONSTANTS):
    if values is None:
        values = dict(constants_values(constants))
        values[0, 9] = 1_384_266_733
        values[0, 13] = 0x01050000
        values[0, 55] = encoded(256)
    payload = b"".join(struct.pack("<HHI", *key, value) for key, value in sorted(values.items()))
    return record(PARAMETERS, time, payload)


def ticks(time):
    return TICKS_1970 + time * 10_000_000


def info(changes=(), serial="MOS2A45130450", rate="30", end="\r\n", **more):
    lines = {"Serial Number": serial, "Firmware": "1.5.0", "Sample Rate": rate, "Start Date": ticks(START),
             "Acceleration Scale": "256.0", "Acceleration Min": "-8.0", "Acceleration Max": "8.0"}
    lines.update(changes)
    return "".join(f"{key}: {value}{end}" for key, value in lines.items() if value is not None).encode()


# -- zip, by PKWARE's description

class Zip:
    """An archive byte by byte; every field can be made wrong."""

    def __init__(self):
        self.out = b""
        self.list = b""
        self.count = 0
        self.places = {}

    def add(self, name, data, deflate=False, behind=False, flags=0, method=None, crc=None, size=None, zip64=False,
            attributes=0o100644 << 16, packed=None, extra=b"", listed=True, signature=True, level=6, at=None):
        raw_name = name if isinstance(name, bytes) else name.encode()
        if packed is None:
            packed = data
            if deflate:
                packer = zlib.compressobj(level, zlib.DEFLATED, -15)
                packed = packer.compress(data) + packer.flush()
        crc = zlib.crc32(data) if crc is None else crc
        size = len(data) if size is None else size
        flags |= 8 if behind else 0
        method = (8 if deflate else 0) if method is None else method
        before = self.out
        offset = len(self.out) if at is None else at
        sizes = struct.pack("<III", crc, len(packed), min(size, 0xFFFFFFFF))
        local_extra = b""
        local = struct.pack("<III", 0, 0, 0) if behind else sizes
        if zip64:
            local_extra = struct.pack("<HHQQ", 1, 16, 0 if behind else size, 0 if behind else len(packed))
            local = struct.pack("<III", 0 if behind else crc, 0xFFFFFFFF, 0xFFFFFFFF)
        self.out += struct.pack("<IHHHHH", 0x04034B50, 45 if zip64 else 20, flags, method, 0, 0x21)
        self.out += local + struct.pack("<HH", len(raw_name), len(local_extra)) + raw_name + local_extra
        self.places[name] = len(self.out)
        self.out += packed
        if behind:
            self.out += b"PK\x07\x08" if signature else b""
            self.out += struct.pack("<IQQ" if zip64 else "<III", crc, len(packed), size)
        if listed:
            if zip64:
                extra += struct.pack("<HHQQ", 1, 16, size, len(packed))
                sizes = struct.pack("<III", crc, 0xFFFFFFFF, 0xFFFFFFFF)
            self.list += struct.pack("<IHHHHHH", 0x02014B50, 0x0314, 45 if zip64 else 20, flags, method, 0, 0x21)
            self.list += sizes + struct.pack("<HHHHHII", len(raw_name), len(extra), 0, 0, 0, attributes, offset)
            self.list += raw_name + extra
            self.count += 1
        if at is not None:  # in the list alone: what stands at that place
            self.out = before
        return self

    def end(self, zip64=False, comment=b""):
        begin = len(self.out)
        out = self.out + self.list
        if zip64:
            at = len(out)
            out += struct.pack("<IQHHIIQQQQ", 0x06064B50, 44, 45, 45, 0, 0, self.count, self.count, len(self.list), begin)
            out += struct.pack("<IIQI", 0x07064B50, 0, at, 1)
            out += struct.pack("<IHHHHIIH", 0x06054B50, 0, 0, 0xFFFF, 0xFFFF, 0xFFFFFFFF, 0xFFFFFFFF, len(comment))
        else:
            out += struct.pack("<IHHHHIIH", 0x06054B50, 0, 0, self.count, self.count, len(self.list), begin, len(comment))
        return out + comment


def archive(log, text=None, **how):
    return Zip().add("log.bin", log, **how).add("info.txt", info() if text is None else text, **how).end()


# -- the suite

class Suite:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.number = 0
        self.bytes = 0

    def put(self, rule, about, data, **expected):
        """Keys of `expected`: README.md. Without `answer`: "read"."""
        self.number += 1
        name = f"{self.number:03}-{rule.lower()}"
        (self.folder / f"{name}.gt3x").write_bytes(data)
        content = {"rule": rule, "about": about, "answer": "read"}
        content.update(expected)
        (self.folder / f"{name}.json").write_text(json.dumps(content, indent=1) + "\n")
        self.bytes += len(data)


def of_seconds(seconds, **more):
    """What a reader gives for [(time, samples)]."""
    lines = [[time, *sample] for time, samples in seconds for sample in samples]
    return {"start": seconds[0][0], "samples": lines, **more}


def plain(count, kind=ACTIVITY, rate=30):
    """A log of `count` seconds, and what it holds."""
    log = parameters() + b"".join(second(i, kind, rate) for i in range(count))
    return log, of_seconds([(START + i, wave(i, rate)) for i in range(count)])


def archives(suite):
    log, truth = plain(2)
    facts = dict(truth, serial="MOS2A45130450", firmware="1.5.0", sample_rate_hz=30, accel_scale_lsb_per_g=256)
    suite.put("Z1", "info.txt and log.bin, stored", archive(log), **facts)
    suite.put("Z2", "both deflated", archive(log, deflate=True), **facts)
    for level in (0, 1, 9):
        suite.put("Z2", f"deflated at level {level}", archive(log, deflate=True, level=level), **facts)
    suite.put("Z2", "one stored, one deflated, info.txt first",
              Zip().add("info.txt", info()).add("log.bin", log, deflate=True).end(), **facts)
    suite.put("Z2", "entries that no reader needs, before and behind",
              Zip().add("a.bin", b"a" * 50).add("info.txt", info()).add("log.bin", log).add("z.txt", b"z").end(), **facts)
    suite.put("Z1", "log.bin and activity.bin: log.bin is read",
              Zip().add("activity.bin", activity(wave(9))).add("info.txt", info()).add("log.bin", log).end(), **facts)
    suite.put("Z1", "no log.bin", Zip().add("info.txt", info()).end(), answer="refused")
    suite.put("Z1", "LOG.BIN is not log.bin", Zip().add("LOG.BIN", log).add("info.txt", info()).end(), answer="refused")
    suite.put("Z1", "log.bin in a folder is not log.bin",
              Zip().add("x/log.bin", log).add("info.txt", info()).end(), answer="refused")
    suite.put("I4", "no info.txt", Zip().add("log.bin", log).end(), answer="refused")
    suite.put("Z1", "an empty archive", Zip().end(), answer="refused")
    suite.put("Z1", "an empty file", b"", answer="refused")
    suite.put("Z1", "text, no archive", b"this is no archive, and long enough to be looked at", answer="refused")
    for deflate in (False, True):
        for zip64 in (False, True):
            suite.put("Z3", f"sizes behind the entries, deflated: {deflate}, zip64: {zip64}",
                      archive(log, deflate=deflate, behind=True, zip64=zip64), **facts)
    suite.put("Z3", "a descriptor without signature", archive(log, deflate=True, behind=True, signature=False), **facts)
    suite.put("Z4", "zip64 entries", archive(log, zip64=True), **facts)
    suite.put("Z4", "a zip64 end record", Zip().add("log.bin", log).add("info.txt", info()).end(zip64=True), **facts)
    for name in ("log.bin", "info.txt", "lux.bin"):
        two = Zip().add("info.txt", info()).add("log.bin", log).add("lux.bin", b"").add(name, b"other")
        suite.put("Z5", f"two entries named {name}", two.end(), answer="refused")
    for name in ("notes/extra.bin", "a/b/c.bin", ".hidden", "__MACOSX/._log.bin", "a..b", "n\u00e4me.bin", "x" * 255):
        suite.put("Z6", f"an entry named {name[:20]}",
                  Zip().add("log.bin", log).add("info.txt", info()).add(name, b"x").end(), **facts)
    for name in ("/etc/x", "../x", "a/../../x", "..", "C:x", "c:/x", "\\x", "..\\x", "a\nb", "y" * 256):
        suite.put("Z6", f"an entry named {name[:20]!r}",
                  Zip().add("log.bin", log).add("info.txt", info()).add(name, b"x").end(), answer="refused")
    suite.put("Z7", "log.bin is a symbolic link",
              Zip().add("log.bin", b"/etc/passwd", attributes=0o120777 << 16).add("info.txt", info()).end(),
              answer="refused")
    suite.put("Z7", "an encrypted entry", Zip().add("log.bin", log, flags=1).add("info.txt", info()).end(),
              answer="refused", says="encrypted")
    for method, says in ((9, "deflate64"), (12, "bzip2"), (14, "LZMA"), (95, "XZ"), (98, "PPMd"), (6, "method 6")):
        suite.put("Z7", f"packed by {says}", Zip().add("log.bin", log, method=method).add("info.txt", info()).end(),
                  answer="refused", says=says)
    many = Zip().add("log.bin", log).add("info.txt", info())
    for i in range(198):
        many.add(f"{i}", b"")
    suite.put("Z8", "200 entries", many.end(), **facts)
    suite.put("Z8", "201 entries", many.add("one more", b"").end(), answer="refused")
    suite.put("Z8", "an entry that claims 2 GiB of 1 KB", archive(log, size=2**31 - 1), answer="refused")
    suite.put("Z8", "an entry that claims 20 GiB",
              Zip().add("log.bin", log, size=20 * 2**30, zip64=True).add("info.txt", info()).end(), answer="refused")
    same = Zip().add("log.bin", log).add("info.txt", info())
    for i in range(9):
        same.add(f"{i}", log, at=0)
    suite.put("Z8", "ten entries of the same bytes", same.end(), answer="refused", says="overlap")
    for behind in (1, 4096, 65_536, 70_000):
        suite.put("Z9", f"{behind} zero bytes behind the archive", archive(log) + bytes(behind), **facts)
    suite.put("Z9", "an end record behind the archive whose list is not there",
              archive(log) + b"junk" + struct.pack("<IHHHHIIH", 0x06054B50, 0, 0, 1, 1, 46, 9999, 0), **facts)
    suite.put("Z10", "a folder is no entry",
              Zip().add("notes/", b"").add("notes/a.txt", b"a").add("log.bin", log).add("info.txt", info()).end(), **facts)
    suite.put("Z10", "a comment", Zip().add("log.bin", log).add("info.txt", info()).end(comment=b"a comment"), **facts)
    wrong = struct.pack("<HHBII", 0x5053, 9, 1, 1 << 20, 77)
    suite.put("Z11", "an index that does not add up",
              Zip().add("log.bin", log, deflate=True, extra=wrong).add("info.txt", info()).end(), **facts)
    suite.put("Z11", "an unknown extra field",
              Zip().add("log.bin", log, extra=struct.pack("<HHI", 0x7777, 4, 1)).add("info.txt", info()).end(), **facts)
    suite.put("Z12", "a wrong CRC", Zip().add("log.bin", log, crc=1).add("info.txt", info()).end(), answer="refused",
              says="--salvage")
    suite.put("Z12", "a wrong CRC of info.txt", Zip().add("log.bin", log).add("info.txt", info(), crc=1).end(),
              answer="refused")
    suite.put("Z12", "a byte more than said",
              Zip().add("log.bin", log, deflate=True, size=len(log) - 1).add("info.txt", info()).end(), answer="refused")
    suite.put("Z12", "a byte less than said",
              Zip().add("log.bin", log, deflate=True, size=len(log) + 1).add("info.txt", info()).end(), answer="refused")


def records(suite):
    for count in (1, 2, 5):
        log, truth = plain(count)
        suite.put("L1", f"{count} seconds", archive(log), records={"ACTIVITY": count, "PARAMETERS": 1}, **truth)
    one = of_seconds([(START, wave(0))])
    suite.put("L1", "a record of 65,535 bytes",
              archive(record(METADATA, START, b"x" * 65_535) + second(0), deflate=True),
              records={"ACTIVITY": 1, "METADATA": 1}, **one)
    suite.put("L1", "a payload that holds separators",
              archive(record(METADATA, START, b"\x1e" * 64) + second(0)), checksum_failures=0, damaged_stretches=0, **one)
    two = of_seconds([(START, wave(0)), (START + 1, wave(1))])
    for zeros in (1, 7, 500):
        suite.put("L3", f"{zeros} zero bytes between records",
                  archive(parameters() + second(0) + bytes(zeros) + second(1)), damaged_stretches=0, checksum_failures=0,
                  **two)
    suite.put("L3", "zero bytes at both ends", archive(bytes(9) + second(0) + second(1) + bytes(9)), damaged_stretches=0,
              **two)
    for kind in (7, 13, 28, 99, 255):
        suite.put("L4", f"a record of type {kind}", archive(second(0) + record(kind, START, b"abc") + second(1)),
                  records={"ACTIVITY": 2, NAMES.get(kind, f"TYPE_{kind}"): 1}, **two)
    for at in (10, 40, 120):
        bad = bytearray(second(1))
        bad[at] ^= 4
        suite.put("L5", f"byte {at} of a record is wrong",
                  archive(second(0) + bytes(bad) + second(2) + second(3)), checksum_failures=1, damaged_stretches=0,
                  records={"ACTIVITY": 4}, gaps=[[START + 1, 1, "damaged"]],
                  **of_seconds([(START, wave(0)), (START + 2, wave(2)), (START + 3, wave(3))]))
    bad = bytearray(second(1))
    bad[-1] ^= 0xFF
    suite.put("L2", "a checksum without the complement",
              archive(second(0) + bytes(bad) + second(2) + second(3)), checksum_failures=1,
              **of_seconds([(START, wave(0)), (START + 2, wave(2)), (START + 3, wave(3))]))
    for junk in (b"\x77", b"\x77" * 50, b"\x1e" * 50, bytes(range(1, 200))):
        suite.put("L6", f"{len(junk)} bytes that are no record",
                  archive(second(0) + second(1) + junk + second(3)), damaged_stretches=1,
                  gaps=[[START + 2, 1, "damaged"]],
                  **of_seconds([(START, wave(0)), (START + 1, wave(1)), (START + 3, wave(3))]))
    long_size = bytearray(second(2))
    long_size[6:8] = struct.pack("<H", 9000)
    suite.put("L6", "a record whose size is wrong costs that record",
              archive(second(0) + second(1) + bytes(long_size) + second(3) + second(4)),
              gaps=[[START + 2, 1, "damaged"]],
              **of_seconds([(START + i, wave(i)) for i in (0, 1, 3, 4)]))
    for left in (1, 8, 100):
        suite.put("L7", f"the last record is cut after {left} bytes",
                  archive(second(0) + second(1) + second(2)[:left]), damaged_stretches=1, **two)
    for time in (0, 1, 2**31 - 1, 2**31, 2**32 - 1):
        suite.put("L9", f"a record of the time {time}", archive(second(0, time=time)), checksum_failures=0,
                  damaged_stretches=0, **of_seconds([(time, wave(0))]))
    suite.put("L8", "an empty log.bin", archive(b""), answer="refused", says="no samples")
    suite.put("L8", "records without samples", archive(parameters() + record(BATTERY, START, b"\x68\x10")),
              answer="refused", says="no samples")
    suite.put("L8", "a log of zeros", archive(bytes(5000)), answer="refused", says="no samples")
    suite.put("L6", "a log of noise", archive(bytes((i * i * 31 + i * 7) % 251 + 1 for i in range(4000))),
              answer="refused", says="no samples")


def samples(suite):
    for rate in (30, 31, 32, 40, 100):
        log, truth = plain(2, ACTIVITY, rate)
        suite.put("S1", f"{rate} samples in a second", archive(log, info(rate=str(rate))), sample_rate_hz=rate, **truth)
        log, truth = plain(2, ACTIVITY2, rate)
        suite.put("S2", f"{rate} samples in a second", archive(log, info(rate=str(rate))), **truth)
        log, truth = plain(2, ACTIVITY3, rate)
        suite.put("S3", f"{rate} samples in a second", archive(log, info(rate=str(rate))), **truth)
    limits = [[2047, -2048, 0], [-2048, 2047, -1], [1, -1, 2047]]
    suite.put("S1", "the limits of 12 bits", archive(second(0, samples=limits)), **of_seconds([(START, limits)]))
    axes = [[100, 200, 300]]
    suite.put("S1", "one sample: Y X Z on disk", archive(second(0, samples=axes)), **of_seconds([(START, axes)]))
    wide = [[32767, -32768, 0], [2048, -2049, 1]]
    suite.put("S2", "the limits of 16 bits", archive(second(0, ACTIVITY2, samples=wide)), **of_seconds([(START, wide)]))
    for more in (b"\x12", b"\x12\x34", b"\x12\x34\x56\x78"):
        body = activity(wave(0))
        suite.put("S4", f"{len(more)} bytes behind the samples", archive(record(ACTIVITY, START, body + more)),
                  **of_seconds([(START, wave(0))]))
    odd = bytearray(activity(wave(0, 31)))
    odd[-1] |= 0x0F
    suite.put("S4", "the half byte behind an odd number is not zero",
              archive(record(ACTIVITY, START, bytes(odd)), info(rate="31")), **of_seconds([(START, wave(0, 31))]))
    for kind in (ACTIVITY, ACTIVITY2, ACTIVITY3):
        suite.put("S5", f"a one-byte record of type {kind}",
                  archive(second(0, kind) + record(kind, START + 1, b"\x01") + second(2, kind)),
                  gaps=[[START + 1, 1, "usb"]], **of_seconds([(START, wave(0)), (START + 2, wave(2))]))
    suite.put("S6", "an empty payload", archive(second(0) + record(ACTIVITY, START + 1, b"") + second(1)),
              **of_seconds([(START, wave(0)), (START + 1, wave(1))]))
    suite.put("S7", "ACTIVITY, then ACTIVITY2", archive(second(0) + second(1, ACTIVITY2)),
              **of_seconds([(START, wave(0)), (START + 1, wave(1))]))
    old = [wave(0), wave(1)]
    old_file = Zip().add("info.txt", info()).add("activity.bin", activity(old[0] + old[1]))
    suite.put("S8", "the old form", old_file.end(), **of_seconds([(START, old[0]), (START + 1, old[1])]))
    suite.put("S8", "the old form, deflated",
              Zip().add("activity.bin", activity(old[0] + old[1]), deflate=True).add("info.txt", info()).end(),
              **of_seconds([(START, old[0]), (START + 1, old[1])]))
    for date in (None, "0", "-5", "9" * 30, "soon"):
        suite.put("S8", f"the old form with a Start Date of {date}: times from 0",
                  Zip().add("info.txt", info({"Start Date": date})).add("activity.bin", activity(old[0])).end(),
                  **of_seconds([(0, old[0])]))
    for serial, scale in (("MOS2A45130450", 256), ("TAS1E31150129", 256), ("NEO1B34100019", 341),
                          ("CLE2A02130001", 341), ("MRA1A00000001", 341), ("neo1b34100019", 341)):
        suite.put("S9", f"no scale is said: {serial}",
                  archive(second(0), info({"Acceleration Scale": None}, serial=serial)), accel_scale_lsb_per_g=scale,
                  **of_seconds([(START, wave(0))]))
    suite.put("S9", "info.txt says it", archive(second(0), info({"Acceleration Scale": "341"})),
              accel_scale_lsb_per_g=341, **of_seconds([(START, wave(0))]))
    suite.put("S9", "PARAMETERS say it, and hold",
              archive(parameters({(0, 55): encoded(340.5)}) + second(0), info({"Acceleration Scale": "256"})),
              accel_scale_lsb_per_g=340.5, **of_seconds([(START, wave(0))]))


def settings(suite):
    one = of_seconds([(START, wave(0))])
    suite.put("P3", "nine constants", archive(parameters() + second(0)), constants=CONSTANTS, **one)
    eight = constants_values(CONSTANTS)
    del eight[1, 16]
    suite.put("P3", "eight constants are none", archive(parameters(eight) + second(0)), constants=None, **one)
    for bad in (2048, -2049, 100_000):
        values = dict(constants_values(CONSTANTS))
        values[1, 7] = bad & 0xFFFFFFFF
        suite.put("P3", f"a constant of {bad} is none", archive(parameters(values) + second(0)), constants=None, **one)
    suite.put("P1", "a payload of 9 bytes is not read",
              archive(record(PARAMETERS, START - 1, bytes(9)) + second(0)), constants=None, **one)
    suite.put("P1", "an empty payload", archive(record(PARAMETERS, START - 1, b"") + second(0)), constants=None, **one)
    for scale in (1, 16.5, 256, 341, 4096.25, 32768):
        suite.put("P2", f"a scale of {scale}",
                  archive(parameters({(0, 55): encoded(scale)}) + second(0), info({"Acceleration Scale": None})),
                  accel_scale_lsb_per_g=scale, **one)
    for code, about in ((0, "0"), (0x007FFFFF, "too large"), (0x00800000, "too large, negative"),
                        (encoded(-256), "-256"), (0x80400000, "nearly 0"), (encoded(32769), "32769")):
        suite.put("P2", f"a scale of {about} is none: the family's holds",
                  archive(parameters({(0, 55): code}) + second(0), info({"Acceleration Scale": None})),
                  accel_scale_lsb_per_g=256, **one)
    suite.put("P4", "a time of calibration", archive(parameters() + second(0)),
              calibration_time="2013-11-12T14:32:13Z", **one)
    suite.put("P4", "the latest that there is", archive(parameters({(0, 9): 0xFFFFFFFF}) + second(0)),
              calibration_time="2106-02-07T06:28:15Z", **one)
    for scale in ("nan", "inf", "-256", "0", "1e30", "0x100", ""):
        suite.put("S9", f"info.txt gives a scale of '{scale}': the family's holds",
                  archive(second(0), info({"Acceleration Scale": scale})), accel_scale_lsb_per_g=256, **one)
    suite.put("P4", "0 is none", archive(parameters({(0, 9): 0}) + second(0)), calibration_time=None, **one)
    suite.put("P5", "the firmware, where info.txt is silent",
              archive(parameters({(0, 13): 0x0107_0203}) + second(0), info({"Firmware": None})), firmware="1.7.515",
              **one)
    other = {"positive_lsb": [300, 301, 302], "negative_lsb": [-300, -301, -302], "zero_lsb": [1, 2, 3]}
    suite.put("P6", "repeated before the first sample: the last holds",
              archive(parameters() + parameters(constants=other) + second(0)), constants=other, **one)
    whole = parameters()[8:-1]
    for key, name, none in (((1, 16), "zero of y", "constants"), ((0, 9), "time of calibration", "calibration_time")):
        again = struct.pack("<HHI", *key, 99)
        for payload, where in ((whole + again, "behind"), (again + whole, "before")):
            suite.put("P7", f"another {name} {where} it in one record: neither is used",
                      archive(record(PARAMETERS, START - 1, payload) + second(0)), **{none: None}, **one)
    suite.put("P7", "an entry that stands twice with one value", archive(record(PARAMETERS, START - 1, whole + whole) + second(0)),
              constants=CONSTANTS, **one)
    facts = dict(serial="MOS2A45130450", sample_rate_hz=30, **one)
    suite.put("I1", "line ends without carriage return", archive(second(0), info(end="\n")), **facts)
    suite.put("I1", "a byte-order mark", archive(second(0), b"\xef\xbb\xbf" + info()), **facts)
    suite.put("I1", "lines that are no pairs", archive(second(0), b"a line\r\n\r\n" + info() + b"and one more"), **facts)
    suite.put("I1", "no line end behind the last line", archive(second(0), info().rstrip()), **facts)
    suite.put("I1", "blanks around keys and values", archive(second(0), info().replace(b": ", b" :  ")), **facts)
    suite.put("I1", "decimal commas", archive(second(0), info({"Acceleration Scale": "341,5"}, rate="30,0")),
              accel_scale_lsb_per_g=341.5, **facts)
    suite.put("I1", "a key that stands twice", archive(second(0), info() + b"Serial Number: OTHER\r\n"), **facts)
    suite.put("I1", "keys are spelt exactly", archive(second(0), info() + b"serial number: OTHER\r\n"), **facts)
    for rate in ("0", "0.5", "-30", "many", "nan", "inf", "1e9", "", None):
        suite.put("I3", f"a rate of {rate}", archive(second(0), info({"Sample Rate": rate})), answer="refused",
                  says="rate")
    suite.put("I4", "info.txt without a pair", archive(second(0), b"nothing of use\r\n"), answer="refused")
    suite.put("I4", "an empty info.txt", archive(second(0), b""), answer="refused")
    suite.put("I4", "info.txt of 1 MiB and more",
              archive(second(0), info() + b"Note: " + b"x" * (1 << 20), deflate=True), answer="refused")
    for date in ("0", "-1", "99999999999999999999", "635641850400000000,5", "x", None):
        suite.put("I2", f"a Last Sample Time of {date} is none",
                  archive(second(0), info({"Last Sample Time": date})), gaps=[], **one)


def gaps(suite):
    two = of_seconds([(START, wave(0)), (START + 10, wave(10))])
    suite.put("G1", "nothing says why", archive(second(0) + second(10)), gaps=[[START + 1, 9, "unexplained"]], **two)
    suite.put("G1", "idle sleep", archive(second(0) + record(EVENT, START, b"\x08") + second(10)),
              gaps=[[START + 1, 9, "idle_sleep"]], **two)
    suite.put("G1", "an EVENT of another kind", archive(second(0) + record(EVENT, START, b"\x09") + second(10)),
              gaps=[[START + 1, 9, "unexplained"]], **two)
    suite.put("G1", "USB", archive(second(0) + record(ACTIVITY, START + 1, b"\x01") + second(10)),
              gaps=[[START + 1, 9, "usb"]], **two)
    suite.put("G1", "damage", archive(second(0) + b"\x77" * 30 + second(10)), gaps=[[START + 1, 9, "damaged"]], **two)
    suite.put("G2", "up to Last Sample Time",
              archive(second(0) + second(1), info({"Last Sample Time": ticks(START + 60)})),
              gaps=[[START + 2, 58, "unexplained"]], **of_seconds([(START, wave(0)), (START + 1, wave(1))]))
    suite.put("G2", "Last Sample Time is that of the last sample",
              archive(second(0) + second(1), info({"Last Sample Time": ticks(START + 1)})), gaps=[],
              **of_seconds([(START, wave(0)), (START + 1, wave(1))]))


def damage(suite):
    seconds = [(START + i, wave(i)) for i in range(4)]
    log = parameters() + b"".join(second(i) for i in range(4))
    size = len(second(0))

    def damaged(rule, about, data, salvaged):
        suite.put(rule, about, data, answer="refused", says="--salvage", salvage=salvaged)

    stored = Zip().add("info.txt", info()).add("log.bin", log)
    at = stored.places["log.bin"]
    for cut_seconds, extra in ((3, 0), (3, 1), (2, 50), (1, size - 1)):
        end = at + len(parameters()) + cut_seconds * size + extra
        damaged("D2", f"stored, cut {extra} bytes behind second {cut_seconds}", stored.out[:end],
                of_seconds(seconds[:cut_seconds], doubtful=["log.bin"], missing=["log.bin"], serial="MOS2A45130450"))
    behind = Zip().add("info.txt", info()).add("log.bin", log, behind=True)
    end = behind.places["log.bin"] + len(parameters()) + 2 * size
    damaged("D2", "stored with its sizes behind it, cut", behind.out[:end],
            of_seconds(seconds[:2], doubtful=["log.bin"]))
    damaged("D4", "cut before the list of entries", stored.out, of_seconds(seconds, missing=[""]))
    for how in ({}, {"deflate": True}, {"behind": True}, {"deflate": True, "behind": True},
                {"zip64": True}, {"deflate": True, "behind": True, "zip64": True}):
        whole = Zip().add("log.bin", log, **how).add("info.txt", info(), **how)
        damaged("D4", f"without a list: {how}", whole.out, of_seconds(seconds, missing=[""], doubtful=[]))
        damaged("D4", f"with half of its list: {how}", whole.out + whole.list[:40],
                of_seconds(seconds, missing=[""], doubtful=[]))
    damaged("D3", "a wrong CRC in the list", archive(log, crc=7), of_seconds(seconds, doubtful=["info.txt", "log.bin"]))
    data = bytearray(archive(log))
    first = Zip().add("log.bin", log).places["log.bin"]
    data[first + len(parameters()) + size + 20] ^= 8
    damaged("D3", "a bit of a sample is wrong", bytes(data),
            of_seconds([seconds[0], *seconds[2:]], doubtful=["log.bin"], missing=["log.bin"]))
    lost = Zip().add("log.bin", log)
    damaged("D5", "info.txt is lost", lost.end(),
            of_seconds(seconds, serial="", firmware="1.5.0", sample_rate_hz=30, accel_scale_lsb_per_g=256,
                       missing=["info.txt"]))
    silent = Zip().add("log.bin", b"".join(second(i, rate=40) for i in range(4)))
    damaged("D5", "info.txt is lost and there are no PARAMETERS: the seconds give the rate", silent.end(),
            of_seconds([(START + i, wave(i, 40)) for i in range(4)], serial="", sample_rate_hz=40,
                       accel_scale_lsb_per_g=None, missing=["info.txt"]))
    noise = bytes(200)
    damaged("D1", "packed bytes that make no sense from the beginning",
            Zip().add("log.bin", log, deflate=True, packed=b"\x07" + noise).add("info.txt", info()).end(),
            {"answer": "refused"})
    broken = zlib.compressobj(0, zlib.DEFLATED, -15)
    packed = broken.compress(log) + broken.flush(zlib.Z_FULL_FLUSH) + b"\x07\x07"
    damaged("D1", "packed bytes that make no sense from a place on",
            Zip().add("log.bin", log + b"more", deflate=True, packed=packed).add("info.txt", info()).end(),
            of_seconds(seconds, missing=["log.bin"], doubtful=["log.bin"]))
    suite.put("D1", "what is not damaged is as without the option", archive(log), salvage=of_seconds(seconds, missing=[], doubtful=[]),
              **of_seconds(seconds))
    suite.put("D1", "an encrypted entry stays refused", Zip().add("log.bin", log, flags=1).add("info.txt", info()).end(),
              answer="refused", says="encrypted", salvage={"answer": "refused"})


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    suite = Suite(sys.argv[1])
    for part in (archives, records, samples, settings, gaps, damage):
        part(suite)
    print(f"{suite.number} files, {suite.bytes} bytes")


if __name__ == "__main__":
    main()
