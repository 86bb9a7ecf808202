"""Files that no command makes: readings of a measurement system study, and a capture of USB transfers.

  make_inputs.py READINGS.csv CAPTURE.pcap
"""
import struct
import sys

with open(sys.argv[1], "w", encoding="utf-8") as file:
    print("part,operator,value", file=file)
    for part in range(5):
        for operator in ("Ada", "Bo", "Cy"):
            for trial in range(2):
                print(f"{part},{operator},{10 * part + 0.1 * len(operator) + 0.3 * trial}", file=file)


def packet(event, endpoint, data, number):
    """Documentation/usb/usbmon.rst, struct usbmon_packet of 64 bytes (link type 220); an interrupt transfer."""
    head = struct.pack("<QccBBHcBqiiII8s", number, event, b"\x01", endpoint, 9, 3, b"-", 0, 1_700_000_000, 1000 * number,
                       0, len(data), len(data), bytes(8)) + struct.pack("<iiII", 1, 0, 0, 0)
    return struct.pack("<IIII", 1_700_000_000, 1000 * number, len(head) + len(data), len(head) + len(data)) + head + data


# https://www.ietf.org/archive/id/draft-ietf-opsawg-pcap-04.html, section 4
with open(sys.argv[2], "wb") as file:
    file.write(struct.pack("<IHHIIII", 0xA1B2C3D4, 2, 4, 0, 0, 262144, 220))
    file.write(packet(b"S", 0x01, bytes(64), 1))
    file.write(packet(b"C", 0x81, bytes(range(64)), 2))
