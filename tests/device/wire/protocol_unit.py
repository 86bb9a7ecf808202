#!/usr/bin/env python3
"""A unit, made of docs/protocol.md alone: what a second implementer would write.

Its carrier is a pair of pipes. On stdin come reports of 64 bytes. On stdout go frames: 'R' or 'B'
(the channel), the length as a little-endian u32, and a report or a block. Time does not pass by
itself: while it streams, every report that is asked for with 64 zero bytes is one of samples.
"""
import hashlib
import struct
import sys
import zlib

from protocol_oracle import REPLY, REQUEST, REQUEST_LENGTH, SAMPLES, Report, crc_ccitt

OK, UNKNOWN, LENGTH, ARGUMENT, BUSY, NO_RECORDING, NO_TRANSACTION, CRC = 0, 1, 2, 3, 4, 5, 8, 9
RATES = range(30, 101, 10)


class Refused(Exception):
    pass


class Unit:
    def __init__(self, serial):
        self.serial = serial
        self.kept = None
        self.page = self.first_page()
        self.staged = None
        self.stream = None
        self.filter = self.power_on_filter = 1
        self.recording = None
        self.recordings = []
        self.clock = 1_400_000_000
        self.out = []

    @staticmethod
    def first_page():
        page = bytearray(range(256)) + bytearray(256)
        page[256:260] = b"TUNE"
        page[260:278] = struct.pack("<9h", 10, 11, 12, 266, 267, 268, -246, -245, -244)
        page[278:284] = bytes([11, 12, 13, 10, 30, 5])  # 2013-11-12 10:30:05
        page[348:352] = b"\x01\x02\x03\x04"
        page[510:512] = struct.pack(">H", crc_ccitt(page[256:510]))
        return bytes(page)

    def take(self, raw):
        if not any(raw):
            self.sample()
            return
        request = Report.decode(raw)
        if request is None:
            if raw[0] != 1 and struct.unpack("<H", raw[62:])[0] == crc_ccitt(raw[:62]):
                sequence, command = struct.unpack("<HB", raw[2:5])
                self.out.append((b"R", Report(REPLY, sequence, command, 11, b"").encode()))
            return
        if request.kind != REQUEST:
            return
        key = (request.sequence, request.command, request.payload)
        if request.sequence == 0 or self.kept is None or self.kept[0] != key:
            blocks = []
            try:
                code, payload = OK, self.execute(request, blocks)
            except Refused as refusal:
                code, payload = refusal.args[0], b""
            reply = Report(REPLY, request.sequence, request.command, code, payload).encode()
            self.kept = (key, reply)
            self.out.append((b"R", reply))
            self.out += [(b"B", block) for block in blocks]
        else:
            self.out.append((b"R", self.kept[1]))

    def execute(self, request, blocks):
        command, payload = request.command, request.payload
        if command != 4 and command not in REQUEST_LENGTH:
            raise Refused(UNKNOWN)
        if command == 4 and not 3 <= len(payload) <= 50:
            raise Refused(LENGTH)
        if command != 4 and len(payload) != REQUEST_LENGTH[command]:
            raise Refused(LENGTH)
        if command == 1:
            return struct.pack("<BBHHH16s12s12s", 1, 0, 4000, 256, 512, self.serial.encode(),
                               b"1.5.0", b"python")
        if command == 2:
            page, offset, length = struct.unpack("<BHB", payload)
            if page != 0 or not 1 <= length <= 48 or offset + length > 512:
                raise Refused(ARGUMENT)
            return self.page[offset:offset + length]
        if command == 3:
            page, length, crc = struct.unpack("<BHH", payload)
            if page != 0 or length != 512:
                raise Refused(ARGUMENT)
            self.staged = (bytearray(b"\xff" * length), crc)
            return b""
        if command in (4, 5, 6) and self.staged is None:
            raise Refused(NO_TRANSACTION)
        if command == 4:
            offset, content = struct.unpack("<H", payload[:2])[0], payload[2:]
            if offset + len(content) > 512:
                raise Refused(ARGUMENT)
            self.staged[0][offset:offset + len(content)] = content
            return b""
        if command == 5:
            offset, length = struct.unpack("<HB", payload)
            if not 1 <= length <= 48 or offset + length > 512:
                raise Refused(ARGUMENT)
            return bytes(self.staged[0][offset:offset + length])
        if command == 6:
            if self.recording is not None:
                raise Refused(BUSY)
            crc = struct.unpack("<H", payload)[0]
            if crc != self.staged[1] or crc != crc_ccitt(self.staged[0]):
                raise Refused(CRC)
            self.page, self.staged = bytes(self.staged[0]), None
            return struct.pack("<H", crc_ccitt(self.page))
        if command == 7:
            self.staged = None
            return b""
        if command == 8:
            return bytes([self.filter, self.power_on_filter])
        if command == 9:
            if payload[0] > 1:
                raise Refused(ARGUMENT)
            if self.stream is not None:
                raise Refused(BUSY)
            self.filter = payload[0]
            return b""
        if command == 10:
            if self.recording is not None:
                raise Refused(BUSY)
            rate = struct.unpack("<H", payload)[0]
            if rate not in RATES:
                raise Refused(ARGUMENT)
            self.stream = [rate, 0, 0]  # rate, report, index
            return b""
        if command == 11:
            count, self.stream = (self.stream[2] if self.stream else 0), None
            return struct.pack("<I", count)
        if command == 12:
            rate, now = struct.unpack("<HI", payload)
            if self.recording is not None or self.stream is not None:
                raise Refused(BUSY)
            if rate not in RATES:
                raise Refused(ARGUMENT)
            self.clock = self.recording = now
            return struct.pack("<H", len(self.recordings) + 1)
        if command == 13:
            if self.recording is None:
                raise Refused(NO_RECORDING)
            # No .gt3x of its own: the protocol carries whatever bytes there are.
            image = b"".join(hashlib.sha256(b"%d" % i).digest() for i in range(1700))
            self.recordings.append((image, self.recording))
            self.recording = None
            return struct.pack("<H", len(self.recordings))
        if command == 14:
            index = struct.unpack("<H", payload)[0]
            if not self.recordings and index == 0:
                return struct.pack("<H", 0)
            if index >= len(self.recordings):
                raise Refused(NO_RECORDING)
            image, start = self.recordings[index]
            return struct.pack("<HHQI", len(self.recordings), index + 1, len(image),
                               start) + hashlib.sha256(image).digest()
        if command == 15:
            number, offset, length = struct.unpack("<HQI", payload)
            if self.recording is not None:
                raise Refused(BUSY)
            if not 1 <= number <= len(self.recordings):
                raise Refused(NO_RECORDING)
            image = self.recordings[number - 1][0]
            if offset > len(image):
                raise Refused(ARGUMENT)
            end = min(offset + length, len(image))
            for at in range(offset, end, 16384):
                content = image[at:min(at + 16384, end)]
                block = b"S6B1" + struct.pack("<HHQI", number, at + len(content) == end, at,
                                              len(content)) + content
                blocks.append(block + struct.pack("<I", zlib.crc32(block)))
            return struct.pack("<Q", end - offset)
        return struct.pack("<QI", 123_456, self.clock)

    def sample(self):
        if self.stream is None:
            return
        rate, report, index = self.stream
        payload = struct.pack("<IQhBB", index, index * 1_000_000 // rate, 2450, self.filter, 6)
        for i in range(6):
            payload += struct.pack("<3h", index + i, -index - i, 256)
        self.out.append((b"R", Report(SAMPLES, report, 0, 0, payload).encode()))
        self.stream = [rate, (report + 1) & 0xFFFF, index + 6]


def main():
    unit = Unit("PYTHON00001")
    while True:
        raw = sys.stdin.buffer.read(64)
        if len(raw) < 64:
            return
        unit.take(raw)
        for channel, content in unit.out:
            sys.stdout.buffer.write(channel + struct.pack("<I", len(content)) + content)
        unit.out = []
        sys.stdout.buffer.write(b"E\0\0\0\0")  # that was all
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
