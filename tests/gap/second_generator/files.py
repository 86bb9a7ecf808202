"""Writes a bundle: recording.gt3x, protocol.json, temperature.csv, host_clock.csv."""

import json
import struct
import zipfile

import numpy as np

TICKS_TO_1970 = 62135596800


def xor(block):
    return int(np.bitwise_xor.reduce(np.frombuffer(block, np.uint8)))


def log_of(counts, rate_hz, start):
    """Records: separator, type, time, length, samples, and the complement of the exclusive or of all before."""
    activity2 = 0x1A
    parts = []
    for second, first in enumerate(range(0, len(counts), rate_hz)):
        payload = counts[first : first + rate_hz].astype("<i2").tobytes()
        body = struct.pack("<BBIH", 0x1E, activity2, start + second, len(payload)) + payload
        parts.append(body + bytes([~xor(body) & 0xFF]))
    return b"".join(parts)


def info_of(header, rate_hz, start, seconds):
    ticks = lambda unix: (unix + TICKS_TO_1970) * 10_000_000
    lines = {
        "Serial Number": header["serial"],
        "Device Type": "wGT3XBT",
        "Firmware": header["firmware"],
        "Battery Voltage": "4.1",
        "Sample Rate": rate_hz,
        "Start Date": ticks(start),
        "Stop Date": 0,
        "Last Sample Time": ticks(start + seconds),
        "TimeZone": "00:00:00",
        "Download Date": ticks(start + seconds + 300),
        "Board Revision": 8,
        "Unexpected Resets": 0,
        "Acceleration Scale": "256.0",
        "Acceleration Min": "-8.0",
        "Acceleration Max": "8.0",
        "Subject Name": header["serial"],
    }
    return "".join(f"{key}: {value}\r\n" for key, value in lines.items())


def segment_json(segment, first, rate_hz):
    out = {
        "name": segment.name,
        "kind": segment.kind,
        "first_sample": first,
        "samples": int(round(segment.seconds * rate_hz)),
        "host_start_s": round(segment.start_s, 4),
        "rotation": [[round(float(v), 9) + 0.0 for v in row] for row in segment.rotation],
        "temperature_c": segment.commanded_c,
    }
    if segment.tone:
        out["vibration"] = {
            "direction_lab": segment.tone["direction"].tolist(),
            "frequency_hz": segment.tone["frequency_hz"],
            "amplitude_g": round(segment.tone["amplitude_g"], 5),
        }
    return out


def write(folder, segments, counts, sample_s, temperature, rate_hz, header, rng):
    folder.mkdir(parents=True)
    start = 1_600_000_000 + int(rng.integers(0, 100_000_000))
    with zipfile.ZipFile(folder / "recording.gt3x", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as z:
        z.writestr("info.txt", info_of(header, rate_hz, start, -(-len(counts) // rate_hz)))
        z.writestr("log.bin", log_of(counts, rate_hz, start))
    listed, stamps, first = [], ["sample_index,host_time_s"], 0
    for segment in segments:
        entry = segment_json(segment, first, rate_hz)
        listed.append(entry)
        for i in range(first, first + entry["samples"], rate_hz):
            stamps.append(f"{i},{sample_s[i] + rng.uniform(-0.002, 0.002):.4f}")
        first += entry["samples"]
    protocol = {
        "schema": "sixpoint/bundle/1",
        "sample_rate_hz": rate_hz,
        "accel_scale_lsb_per_g": 256,
        "gravity_g": 1.0,
        "unit": {"serial": header["serial"], "model": "wGT3X-BT", "firmware": header["firmware"]},
        "segments": listed,
    }
    (folder / "protocol.json").write_text(json.dumps(protocol))
    (folder / "host_clock.csv").write_text("\n".join(stamps) + "\n")
    readings = temperature.celsius + 0.1 * rng.normal(size=len(temperature.celsius))
    rows = [f"{t + 0.5:.2f},{c:.2f}" for t, c in zip(temperature.time_s, readings)]
    (folder / "temperature.csv").write_text("host_time_s,temperature_c\n" + "\n".join(rows) + "\n")
