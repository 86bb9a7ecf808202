#!/usr/bin/env python3
"""Makes a starting corpus: make_corpus.py FOLDER

FOLDER/TARGET gets, for the targets of recordings, the files of the conformance suite (tests/gt3x/conformance) or the
parts of them that the target reads; for those of texts, the examples of the documents; and small ones written here.
Python's standard library alone.
"""
import json
import pathlib
import re
import sqlite3
import struct
import sys
import tempfile
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests/gt3x/conformance"))
import make  # noqa: E402

# The document whose blocks of code the target reads.
EXAMPLES = {"calib_constants": "constants-file.md", "sim_scenario": "scenario.md", "mocks_fault_plan": "faults.md",
            "station_limits": "limits.md"}

CALIBRATIONS = (
    {"isCalibrated": False, "calibrationMethod": 2, "deviceType": "x", "calibrationResults": [
        {"sampleRate": 32, "sensitivityXX": 0.004, "sensitivityYY": 0.004, "sensitivityZZ": 0.004, "sensitivityXY": 0,
         "sensitivityXZ": 0, "sensitivityYZ": 0, "offsetX": 1, "offsetY": 2, "offsetZ": 3}]},
    {"isCalibrated": True},
    {"calibrationResults": []})


def payloads(log, kind):
    """Payloads of the records of one type in a log that is whole."""
    at = 0
    while at + 9 <= len(log) and log[at] == 0x1E:
        size = struct.unpack_from("<H", log, at + 6)[0]
        if log[at + 1] == kind:
            yield log[at + 8:at + 8 + size]
        at += 9 + size


def agd(rows):
    """An .agd with these settings."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "x.agd"
        base = sqlite3.connect(path)
        base.execute("CREATE TABLE settings (settingID INTEGER, settingName TEXT, settingValue TEXT)")
        base.executemany("INSERT INTO settings VALUES (?, ?, ?)", [(i, *row) for i, row in enumerate(rows)])
        base.commit()
        base.close()
        return path.read_bytes()


def schema():
    column = struct.pack("<BBBI16s", 3, 0, 16, make.encoded(2048), b"Accelerometer X ")
    return struct.pack("<HHH", 1, 1, 0) + column


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    root = pathlib.Path(sys.argv[1])
    saved = {}

    def save(target, content):
        if len(content) <= 20_000 and content not in saved.setdefault(target, set()):
            folder = root / target
            folder.mkdir(parents=True, exist_ok=True)
            (folder / f"seed{len(saved[target]):03}").write_bytes(content)
            saved[target].add(content)

    with tempfile.TemporaryDirectory() as folder:
        suite = make.Suite(folder)
        for part in (make.archives, make.records, make.samples, make.settings, make.gaps, make.damage):
            part(suite)
        for path in sorted(pathlib.Path(folder).glob("*.gt3x")):
            save("gt3x_recording", path.read_bytes())
            save("gt3x_salvage", path.read_bytes())
            if json.loads(path.with_suffix(".json").read_text())["answer"] != "read":
                continue
            try:
                entries = zipfile.ZipFile(path)
            except zipfile.BadZipFile:  # more bytes behind the archive than this reader allows
                continue
            save("gt3x_info", entries.read("info.txt"))
            for name in set(entries.namelist()) & {"log.bin", "activity.bin"}:
                content = entries.read(name)
                save("gt3x_log" if name == "log.bin" else "gt3x_activity", content)
                save("repair_rescale", b"\x02" + content)
                for payload in payloads(content, make.PARAMETERS):
                    save("gt3x_parameters", payload)
    for calibration in CALIBRATIONS:
        save("gt3x_calibration", json.dumps(calibration).encode())
    save("gt3x_sensor_schema", struct.pack("<H", len(schema())) + schema() + struct.pack("<Hhh", 1, 100, -100))
    for payload in (b"\x68\x10", b"\x08", b"\x07\x00", b"{}", bytes(6)):
        save("gt3x_sensor_schema", b"\0\0" + payload)
    save("repair_agd", agd([("deviceserial", "MOS2A45130450"), ("deviceversion", "1.5.0")]))
    save("repair_agd", agd([]))
    for target, document in EXAMPLES.items():
        for block in re.findall(r"^```(?:json|toml)\n(.*?)^```", (ROOT / "docs" / document).read_text(), re.M | re.S):
            save(target, block.encode())
    for document in sorted((ROOT / "docs").rglob("*.md")):
        for setting in re.findall(r"virtual:([a-z0-9_=,.+-]+)", document.read_text()):
            save("mocks_settings", setting.encode())
    rests = "".join(f"{second / 10},{second % 3 - 1},0.01,-0.02\n" for second in range(900))
    save("gap_table", b"\0" + ("time_s,x_g,y_g,z_g\n" + rests).encode())
    print({target: len(contents) for target, contents in sorted(saved.items())})


if __name__ == "__main__":
    main()
