#!/usr/bin/env python3
"""One line for each source that clang-tidy reads: a digest of all of the project that it reads there, and the file.

  scripts/tidy_digests.py [FILE...]

The digest covers .clang-tidy, the source, and every file of the project that it includes, itself or through
another one; lines of comment only where they speak to clang-tidy. Includes name files from the root of the project, so no compiler is needed. What Debian ships is not
covered: an update of a system header does not make the project's files unread.
"""
import hashlib
import pathlib
import re
import subprocess
import sys

project = pathlib.Path(__file__).resolve().parent.parent
ROOMS = ["base", "gt3x", "calib", "sim", "device", "mocks", "db", "repair", "gap", "station", "cli", "packaging", "bindings"]
includes, hashes = {}, {}


def read(file):
    if file not in includes:
        content = (project / file).read_bytes()
        lines = content.splitlines(keepends=True)
        read_by_tidy = [line for line in lines if not line.lstrip().startswith(b"//") or b"NOLINT" in line]
        hashes[file] = hashlib.sha256(b"".join(read_by_tidy)).digest()
        named = re.findall(rb'^#include "([^"]+)"', content, re.MULTILINE)
        includes[file] = [name for name in (name.decode() for name in named) if (project / name).exists()]
    return includes[file]


def closure(file):
    found, left = set(), [file]
    while left:
        next_file = left.pop()
        if next_file not in found:
            found.add(next_file)
            left += read(next_file)
    return sorted(found)


def digest(file):
    total = hashlib.sha256((project / ".clang-tidy").read_bytes())
    for part in closure(file):
        total.update(part.encode() + b"\0" + hashes[part])
    return total.hexdigest()[:16]


listed = subprocess.run(["git", "ls-files", *(f"{room}/*.cpp" for room in ROOMS)], cwd=project, check=True,
                        capture_output=True, text=True).stdout.split()
for file in sys.argv[1:] or listed:
    print(digest(file), file)
