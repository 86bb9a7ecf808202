#!/usr/bin/env python3
"""Makes a starting corpus of what the program writes: make_seeds.py WRITTEN FOLDER

WRITTEN holds session.zip, a recorded session, store.jsonl, an export of a store, and bundle, a folder (fuzz/run.sh).
FOLDER/device_protocol gets one report of each kind and command, FOLDER/device_session pieces of the session,
FOLDER/device_pcap its beginning as a USB capture in every form that is read (docs/sessions.md), written from the formats'
public descriptions; FOLDER/db_import and FOLDER/db_journal the first rows of the store; FOLDER/gap_bundle the bundle's
texts.
"""
import itertools
import json
import pathlib
import struct
import sys
import zipfile

BUS, DEVICE = 3, 5
LINK_USBMON, LINK_USBMON_MAPPED, LINK_USBPCAP = 189, 220, 249
INTERRUPT, BULK = 1, 3


def payload(transfer):
    return bytes.fromhex(transfer.get("hex", ""))


def packet(transfer, link, order):
    """One transfer as the capturing driver hands it on."""
    out = transfer["kind"] == "out"
    reports = transfer["channel"] == "reports"
    endpoint = (1 if reports else 2) | (0 if out else 0x80)
    transfer_type = INTERRUPT if reports else BULK
    data = payload(transfer)
    if link == LINK_USBPCAP:
        header = struct.pack("<HQIHBHHBBI", 27, 1, 0, 9, 0 if out else 1, BUS, DEVICE, endpoint,
                             transfer_type, len(data))
        return header + data
    seconds, rest_ns = divmod(transfer["t_ns"], 10**9)
    event = ord("S" if out else "C")
    header = struct.pack(order + "QBBBBHBBqiiII8x", 1, event, transfer_type, endpoint, DEVICE, BUS,
                         ord("-"), 0, seconds, rest_ns // 1000, 0, len(data), len(data))
    return header + (bytes(16) if link == LINK_USBMON_MAPPED else b"") + data


def pcap(transfers, link, order):
    file = struct.pack(order + "IHHIIII", 0xA1B2C3D4, 2, 4, 0, 0, 262144, link)
    for transfer in transfers:
        data = packet(transfer, link, order)
        seconds, rest_ns = divmod(transfer["t_ns"], 10**9)
        file += struct.pack(order + "IIII", seconds, rest_ns // 1000, len(data), len(data)) + data
    return file


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    written = pathlib.Path(sys.argv[1])
    lines = zipfile.ZipFile(written / "session.zip").read("transfers.jsonl").splitlines(keepends=True)
    transfers = [json.loads(line) for line in lines]

    def save(target, name, content):
        folder = pathlib.Path(sys.argv[2]) / target
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)

    for transfer in transfers:
        report = payload(transfer)
        if transfer["channel"] == "reports" and len(report) == 64:
            save("device_protocol", f"kind{report[1]}-command{report[4]}", report)
    for count in (4, 12, 30, 60):
        save("device_session", f"first{count}", b"".join(lines[:count]))
        save("device_session", f"last{count}", b"".join(lines[-count:]))
    seen = [transfer for transfer in transfers if transfer["kind"] in ("in", "out")]
    for link, order, count in itertools.product(
            (LINK_USBMON, LINK_USBMON_MAPPED, LINK_USBPCAP), "<>", (3, 14)):
        name = f"{link}-{'big' if order == '>' else 'little'}-{count}"
        save("device_pcap", f"{name}.pcap", pcap(seen[:count], link, order))

    exported = [json.loads(line) for line in (written / "store.jsonl").read_text().splitlines()]
    rows = [line for line in exported if "row" in line]
    for count in range(1, len(rows) + 1):
        head = exported[0] | {"rows": count, "head": rows[count - 1]["hash"]}
        save("db_import", f"first{count}", "".join(json.dumps(line) + "\n" for line in [head, *rows[:count]]).encode())
    # The first byte makes the target add the checksum.
    entry = {"schema": "sixpoint/journal-entry/2", "rows": [{key: row[key] for key in ("table", "row")} for row in rows]}
    save("db_journal", "rows", b"\0" + json.dumps(entry).encode())
    # The first byte says which of the three it is.
    for which, name in enumerate(("protocol.json", "temperature.csv", "host_clock.csv")):
        save("gap_bundle", name, bytes([which]) + (written / "bundle" / name).read_bytes())


if __name__ == "__main__":
    main()
