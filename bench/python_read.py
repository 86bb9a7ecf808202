#!/usr/bin/env python3
"""How long the Python package takes to read a recording, against inflating it.

  PYTHONPATH=build/python /usr/bin/python3 bench/python_read.py RECORDING [ROUNDS]

The baseline of the same run: libdeflate inflates log.bin, and numpy copies the array once. Both are
told as the best of the rounds, each in a process of its own, with the most memory it had.
"""

import ctypes
import ctypes.util
import json
import resource
import struct
import subprocess
import sys
import time
import zipfile


def packed_log(path):
    with zipfile.ZipFile(path) as archive:
        entry = archive.getinfo("log.bin")
        if entry.compress_type != zipfile.ZIP_DEFLATED:
            sys.exit(f"{path}: log.bin is stored, so there is nothing to inflate")
    with open(path, "rb") as file:
        file.seek(entry.header_offset)
        header = file.read(30)
        name, extra = struct.unpack_from("<HH", header, 26)
        file.seek(entry.header_offset + 30 + name + extra)
        return file.read(entry.compress_size), entry.file_size


def inflate(path):
    packed, size = packed_log(path)
    library = ctypes.CDLL(ctypes.util.find_library("deflate"))
    library.libdeflate_alloc_decompressor.restype = ctypes.c_void_p
    decompressor = ctypes.c_void_p(library.libdeflate_alloc_decompressor())
    start = time.perf_counter()
    out = ctypes.create_string_buffer(size)
    failed = library.libdeflate_deflate_decompress(
        decompressor, packed, ctypes.c_size_t(len(packed)), out, ctypes.c_size_t(size), None
    )
    assert not failed
    return time.perf_counter() - start


def copy(path):
    import sixpoint

    acceleration = sixpoint.read(path, unit="lsb").acceleration
    start = time.perf_counter()
    acceleration.copy()
    return time.perf_counter() - start


def read(path, **options):
    import sixpoint
    from sixpoint import _recording  # noqa: F401  (loads numpy and the library)

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    recording = sixpoint.read(path, **options)
    seconds = time.perf_counter() - start
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return seconds, recording.acceleration.nbytes / 1e6, (most - before) * 1024 / 1e6


WORK = {
    "inflate": inflate,
    "copy": copy,
    "int16": lambda path: read(path, unit="lsb"),
    "float32": lambda path: read(path, dtype="float32"),
    "float64": lambda path: read(path),
}


def measured(name, path):
    child = [sys.executable, __file__, "--work", name, path]
    return json.loads(subprocess.run(child, check=True, capture_output=True, text=True).stdout)


def main():
    if sys.argv[1:2] == ["--work"]:
        print(json.dumps(WORK[sys.argv[2]](sys.argv[3])))
        return
    path = sys.argv[1]
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    best = {}
    for _ in range(rounds):
        for name in WORK:
            got = measured(name, path)
            if name not in best or got < best[name]:
                best[name] = got
    baseline = best["inflate"] + best["copy"]
    print(f"inflate {best['inflate']:.3f} s, copy of int16 {best['copy']:.3f} s")
    for name in ("int16", "float32", "float64"):
        seconds, array_mb, more_mb = best[name]
        print(
            f"read {name:8} {seconds:.3f} s, {seconds / baseline:.2f} of inflate and copy, array "
            f"{array_mb:.0f} MB, most memory beyond it {more_mb - array_mb:.0f} MB"
        )
    imports = []
    for _ in range(rounds * 2):
        code = "import time; t = time.perf_counter(); import sixpoint; print(time.perf_counter() - t)"
        done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
        imports.append(float(done.stdout))
    print(f"import sixpoint {1000 * min(imports):.1f} ms")


if __name__ == "__main__":
    main()
