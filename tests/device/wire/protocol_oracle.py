#!/usr/bin/env python3
"""A second implementation of docs/protocol.md, and of nothing else of this project.

    protocol_oracle.py session.zip

Reads a recorded session (docs/sessions.md), decodes every transfer by the text of docs/protocol.md
alone, follows the sequence rules, and prints what it understood as JSON: one word per transfer, and
what the transfers add up to (the stream, the calibration page, the download). Every message that it
decodes it also encodes again; a difference is an error. The test holds it against device/wire/protocol.h.
Exit code 1 where the session contradicts the protocol.
"""
import hashlib
import json
import struct
import sys
import zipfile
import zlib

COMMANDS = {1: "identify", 2: "read_page", 3: "begin_write", 4: "write_staged", 5: "read_staged",
            6: "commit", 7: "abort_write", 8: "get_filter", 9: "set_filter", 10: "start_stream",
            11: "stop_stream", 12: "start_recording", 13: "stop_recording", 14: "list_recording",
            15: "download", 16: "get_time"}
# Exact lengths of requests; those of WRITE_STAGED are 2 and 1 to 48 bytes.
REQUEST_LENGTH = {1: 0, 2: 4, 3: 5, 5: 3, 6: 2, 7: 0, 8: 0, 9: 1, 10: 2, 11: 0, 12: 6, 13: 0,
                  14: 2, 15: 14, 16: 0}
REQUEST, REPLY, SAMPLES = 1, 2, 3


def crc_ccitt(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


assert crc_ccitt(b"123456789") == 0x29B1  # the page's own example


class Report:
    """One report, or None from decode() where it has to be dropped."""

    def __init__(self, kind, sequence, command, code, payload):
        self.kind, self.sequence, self.command = kind, sequence, command
        self.code, self.payload = code, payload

    @staticmethod
    def decode(raw):
        if len(raw) != 64:
            return None
        version, kind, sequence, command, code, length, zero = struct.unpack("<BBHBBBB", raw[:8])
        if crc_ccitt(raw[:62]) != struct.unpack("<H", raw[62:])[0]:
            return None
        if version != 1 or kind not in (REQUEST, REPLY, SAMPLES) or length > 54 or zero != 0:
            return None
        if any(raw[8 + length:62]):
            return None
        return Report(kind, sequence, command, code, raw[8:8 + length])

    def encode(self):
        head = struct.pack("<BBHBBBB", 1, self.kind, self.sequence, self.command, self.code,
                           len(self.payload), 0)
        body = head + self.payload + bytes(54 - len(self.payload))
        return body + struct.pack("<H", crc_ccitt(body))


def text(raw):
    return raw.split(b"\0")[0].decode("ascii")


class Station:
    """What a station would conclude from the transfers that it had."""

    def __init__(self):
        self.words, self.trouble = [], []
        self.damaged = self.late = self.repeats = 0
        self.asked = None  # the request in flight
        self.last = None   # the one before a repeat
        self.requests = {}
        self.identity = None
        self.page, self.pages = bytearray(512), set()
        self.constants = None
        self.written = {}
        self.samples, self.duplicates, self.lost = [], 0, 0
        self.next_report = self.next_index = None
        self.recordings, self.download = {}, bytearray()
        self.download_from = None
        self.wrong_blocks = 0

    def take(self, transfer):
        if transfer["kind"] == "reopened" or "hex" not in transfer:
            self.words.append(transfer["kind"])
            return
        raw = bytes.fromhex(transfer["hex"])
        if transfer["channel"] == "bulk":
            self.words.append(self.take_block(raw))
            return
        report = Report.decode(raw)
        if report is None:
            self.damaged += 1
            self.words.append("damaged")
            return
        if report.encode() != raw:
            self.trouble.append("a report is encoded otherwise: " + raw.hex())
        self.words.append(" ".join(str(part) for part in (
            {REQUEST: "request", REPLY: "reply", SAMPLES: "samples"}[report.kind], report.sequence,
            report.command, report.code, report.payload.hex() or "-")))
        if transfer["kind"] == "out":
            self.take_request(report)
        elif report.kind == REPLY:
            self.take_reply(report)
        elif report.kind == SAMPLES:
            self.take_samples(report)

    def take_request(self, report):
        if report.kind != REQUEST or report.command not in COMMANDS or report.code != 0:
            self.trouble.append("the station sent what is no request")
            return
        wanted = REQUEST_LENGTH.get(report.command)
        if wanted is None and not 3 <= len(report.payload) <= 50:
            self.trouble.append("WRITE_STAGED of another length")
        elif wanted is not None and len(report.payload) != wanted:
            self.trouble.append(COMMANDS[report.command] + " of another length")
        same = self.last is not None and (
            self.last.sequence, self.last.command, self.last.payload) == (
            report.sequence, report.command, report.payload)
        if same:
            self.repeats += 1
        elif report.sequence == 0:
            if report.command != 1:
                self.trouble.append("sequence 0 on another command than IDENTIFY")
        elif self.last is not None:
            after = self.last.sequence % 65535 + 1
            if report.sequence != after:
                self.trouble.append("sequence %d after %d" % (report.sequence, self.last.sequence))
        name = COMMANDS[report.command]
        self.requests[name] = self.requests.get(name, 0) + 1
        self.last = self.asked = report
        if name == "start_stream" and not same:
            self.next_report, self.next_index = None, 0
        if name == "download" and not same:
            self.download_from = struct.unpack("<HQI", report.payload)

    def take_reply(self, report):
        asked = self.asked
        if asked is None or (asked.sequence, asked.command) != (report.sequence, report.command):
            self.late += 1
            return
        self.asked = None
        if report.code != 0:
            if report.payload:
                self.trouble.append("a refusal with a payload")
            return
        name, payload = COMMANDS[report.command], report.payload
        if name == "identify":
            version, kind, battery, scale, page_bytes = struct.unpack("<BBHHH", payload[:8])
            self.identity = {"version": version, "kind": kind, "battery_mv": battery,
                             "accel_scale": scale, "page_bytes": page_bytes,
                             "serial": text(payload[8:24]), "firmware": text(payload[24:36]),
                             "model": text(payload[36:48])}
        elif name == "read_page":
            _, offset, length = struct.unpack("<BHB", asked.payload)
            if len(payload) < length:
                self.trouble.append("READ_PAGE gave less than was asked for")
            self.page[offset:offset + length] = payload[:length]
            self.pages.update(range(offset, offset + length))
            if len(self.pages) == 512 and self.constants is None:
                self.constants = self.read_constants(bytes(self.page))
        elif name == "write_staged":
            offset = struct.unpack("<H", asked.payload[:2])[0]
            for i, byte in enumerate(asked.payload[2:]):
                self.written[offset + i] = byte
        elif name == "begin_write":
            self.written = {}
            self.announced = struct.unpack("<BHH", asked.payload)
        elif name == "commit":
            staged = bytes(self.written.get(i, 0xFF) for i in range(self.announced[1]))
            crcs = {crc_ccitt(staged), self.announced[2],
                    struct.unpack("<H", asked.payload)[0], struct.unpack("<H", payload[:2])[0]}
            if len(crcs) != 1:
                self.trouble.append("COMMIT: the CRCs differ")
            # What is read from now on is the new page.
            self.pages, self.constants = set(), None
        elif name == "list_recording":
            if struct.unpack("<H", payload[:2])[0] > 0:
                _, number, size, start = struct.unpack("<HHQI", payload[:16])
                self.recordings[number] = {"bytes": size, "start": start,
                                           "sha256": payload[16:48].hex()}

    @staticmethod
    def read_constants(page):
        if page[256:260] != b"TUNE":
            return None
        if struct.unpack(">H", page[510:512])[0] != crc_ccitt(page[256:510]):
            return None
        values = struct.unpack("<9h", page[260:278])
        month, day, year, hour, minute, second = page[278:284]
        return {"zero_lsb": values[0:3], "positive_lsb": values[3:6], "negative_lsb": values[6:9],
                "calibrated": "%04d-%02d-%02dT%02d:%02d:%02dZ" % (
                    year + 2000, month, day, hour, minute, second)}

    def take_samples(self, report):
        payload = report.payload
        if len(payload) < 16:
            self.damaged += 1
            return
        index, time_us, temperature, stream_filter, count = struct.unpack("<IQhBB", payload[:16])
        if not 1 <= count <= 6 or len(payload) < 16 + 6 * count or self.next_index is None:
            self.damaged += 1
            return
        ahead = (index - self.next_index + 2**31) % 2**32 - 2**31
        if ahead < 0:
            self.duplicates += 1
            return
        follows = self.next_report is None or report.sequence == self.next_report
        if self.next_report is not None and follows != (ahead == 0):
            self.damaged += 1
            return
        self.lost += ahead
        self.next_report, self.next_index = (report.sequence + 1) & 0xFFFF, index + count
        for i in range(count):
            self.samples.append((index + i, time_us) + struct.unpack(
                "<3h", payload[16 + 6 * i:22 + 6 * i]) + (temperature, stream_filter))

    def take_block(self, raw):
        if len(raw) < 24 or raw[:4] != b"S6B1" or struct.unpack(
                "<I", raw[-4:])[0] != zlib.crc32(raw[:-4]):
            return "damaged block"
        number, flags, offset, length = struct.unpack("<HHQI", raw[4:20])
        if not 1 <= length <= 16384 or length != len(raw) - 24:
            return "damaged block"
        if self.download_from and number == self.download_from[0] and offset == len(self.download):
            self.download += raw[20:-4]
        else:
            self.wrong_blocks += 1
        return "block %d %d %d %s" % (number, flags, offset,
                                      hashlib.sha256(raw[20:-4]).hexdigest())

    def report(self):
        samples = hashlib.sha256(repr(self.samples).encode()).hexdigest()
        sums = [sum(sample[2 + axis] for sample in self.samples) for axis in range(3)]
        return {"transfers": self.words, "trouble": self.trouble, "requests": self.requests,
                "damaged": self.damaged, "late": self.late, "repeats": self.repeats,
                "identity": self.identity, "constants": self.constants,
                "stream": {"samples": len(self.samples), "lost": self.lost,
                           "duplicates": self.duplicates, "sums": sums, "sha256": samples},
                "recordings": self.recordings, "wrong_blocks": self.wrong_blocks,
                "download": {"bytes": len(self.download),
                             "sha256": hashlib.sha256(self.download).hexdigest()}}


def main():
    station = Station()
    with zipfile.ZipFile(sys.argv[1]) as session:
        head = json.loads(session.read("session.json"))
        lines = session.read("transfers.jsonl")
        if hashlib.sha256(lines).hexdigest() != head["sha256"]:
            station.trouble.append("session.json names another hash")
        transfers = [json.loads(line) for line in lines.splitlines()]
        if len(transfers) != head["transfers"]:
            station.trouble.append("session.json names another count")
        for transfer in transfers:
            station.take(transfer)
    json.dump(station.report(), sys.stdout)
    return 1 if station.trouble else 0


if __name__ == "__main__":
    sys.exit(main())
