#!/usr/bin/env python3
"""A reader of .gt3x files that shares nothing with the program: Python's zipfile and the vendor's public
description of log.bin, read as the common readers do it: entries by name, records one behind the other.

    independent_reader.py SIXPOINT SCENARIO FOLDER

Makes a recording, repairs it, and checks the repaired file against the original.
"""
import hashlib
import json
import math
import struct
import subprocess
import sys
import zipfile


def records(log):
    """(type, time, payload, raw) of every record; zero bytes between records are passed over."""
    at = 0
    while at < len(log):
        if log[at] == 0:
            at += 1
            continue
        assert log[at] == 0x1E, f"no separator at {at}"
        kind, time, size = struct.unpack_from("<BIH", log, at + 1)
        raw = log[at:at + 9 + size]
        check = 0
        for byte in raw[:-1]:
            check ^= byte
        assert raw[-1] == (~check & 0xFF), f"wrong checksum at {at}"
        yield kind, time, raw[8:-1], raw
        at += len(raw)


def samples(payload):
    """12-bit values, most significant bit first, in the order Y X Z."""
    bits = int.from_bytes(payload, "big")
    count = len(payload) * 8 // 12
    values = []
    for i in range(count):
        value = bits >> (len(payload) * 8 - 12 * (i + 1)) & 0xFFF
        values.append(value - 4096 if value > 2047 else value)
    return [(values[i + 1], values[i], values[i + 2]) for i in range(0, count - 2, 3)]


def read(path):
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        entries = {name: archive.read(name) for name in archive.namelist()}
    info = dict(line.split(": ", 1) for line in entries["info.txt"].decode("utf-8-sig").splitlines()
                if ": " in line)
    return entries, info, list(records(entries["log.bin"]))


def still_error_mg(recording, scale):
    """Mean distance from 1 g of the mean of every second that hardly moves."""
    errors = []
    for kind, _, payload, _ in recording:
        if kind != 0 or len(payload) <= 1:
            continue
        second = samples(payload)
        axes = list(zip(*second))
        if max(max(axis) - min(axis) for axis in axes) > 10:
            continue
        mean = [sum(axis) / len(axis) / scale for axis in axes]
        errors.append(1000 * abs(math.sqrt(sum(value * value for value in mean)) - 1))
    assert len(errors) > 60, "the recording holds too few still seconds for this test"
    return sum(errors) / len(errors)


def main():
    program, scenario, folder = sys.argv[1:]
    original, repaired = f"{folder}/original.gt3x", f"{folder}/repaired/original.gt3x"
    subprocess.run([program, "simulate", "--scenario", scenario, "-o", original], check=True)
    subprocess.run([program, "repair", original, "-o", f"{folder}/repaired", "--scan"], check=True)

    before, info_before, log_before = read(original)
    after, info_after, log_after = read(repaired)
    assert info_before == info_after
    assert set(after) - set(before) == {"sixpoint-repair.json"}
    assert json.loads(after["sixpoint-repair.json"])["schema"] == "sixpoint/repair-mark/1"
    for name in before:
        assert name == "log.bin" or before[name] == after[name], f"{name} changed"
    # The mark is the first record: METADATA as the vendor writes it, which readers take for text.
    mark, log_after = log_after[0], log_after[1:]
    assert mark[0] == 6 and mark[1] == log_before[0][1]
    metadata = json.loads(mark[2])
    assert metadata["MetadataType"] == "SixpointRepair" and metadata["Parsed"] is False
    with open(original, "rb") as file:
        assert metadata["InputSha256"] == hashlib.sha256(file.read()).hexdigest()
    assert len(log_before) == len(log_after)
    changed = 0
    for was, now in zip(log_before, log_after):
        assert was[:2] == now[:2]
        if was[0] == 0 and len(was[2]) > 1:
            changed += was[3] != now[3]
        else:
            assert was[3] == now[3], f"a record of type {was[0]} changed"
    assert changed > 100
    scale = float(info_before.get("Acceleration Scale", "256").replace(",", "."))
    error_before, error_after = still_error_mg(log_before, scale), still_error_mg(log_after, scale)
    print(f"{changed} sample records changed, still error {error_before:.1f} -> {error_after:.1f} mg")
    assert error_before > 60 and error_after < 5


if __name__ == "__main__":
    main()
