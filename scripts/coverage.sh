#!/usr/bin/env bash
# Which lines and branches of the program its unit tests run (gcov), room by room; fails where the rooms that decide
# (calib, gt3x, repair, db, device, gap, station/run, station/limits) have less than 92 % of lines or 80 % of branches.
# The tests of PostgreSQL and of USB run too: they alone reach those files. Works from a fresh clone on a fresh Debian 12 as
# root; an hour on two cores. The branches that only an exception takes are not counted: the compiler makes one at every call.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/install_packages.sh build test coverage
source scripts/build_environment.sh
configure coverage
wings=(base calib gt3x sim device mocks db repair gap station cli)
cmake --build build/coverage --target "${wings[@]/%/_tests}" db_postgres_tests usb_tests -- --quiet
find build/coverage -name '*.gcda' -delete
status=0
for wing in "${wings[@]}"; do
  echo "== $wing"
  "build/coverage/tests/$wing/${wing}_tests" --gtest_brief=1 || status=1
done
echo "== PostgreSQL, USB"
ctest --test-dir build/coverage --no-tests=error -R '^(db\.postgres$|usb\.)' -j "$(nproc)" --output-on-failure || status=1
[ "$status" = 0 ] || { echo "FAILED: what failed above counts as not run"; exit 1; }
rooms='^(calib|gt3x|repair|db|device|gap|station/run|station/limits)/'
gcovr --root . --object-directory build/coverage --filter "$rooms" -j "$(nproc)" --exclude-throw-branches \
  --exclude-unreachable-branches --json build/coverage/lines.json --txt build/coverage/files.txt build/coverage
python3 - build/coverage/lines.json <<'PYTHON'
import collections, json, os, sys

rooms = collections.defaultdict(lambda: [0, 0, 0, 0])
for file in json.load(open(sys.argv[1]))["files"]:
    # Headers are included by links (cmake/SixpointRoom.cmake): they count for the room in which they stand.
    name = os.path.relpath(os.path.realpath(file["file"])).split("/")
    room = "/".join(name[:2]) if name[0] == "station" else name[0]
    for line in file["lines"]:
        if line.get("gcovr/noncode"):
            continue
        branches = line.get("branches", [])
        for key in (room, "all of them"):
            rooms[key][0] += line["count"] > 0
            rooms[key][1] += 1
            rooms[key][2] += sum(branch["count"] > 0 for branch in branches)
            rooms[key][3] += len(branches)
print(f"{'':16} {'lines':>8} {'branches':>9}")
short = False
for room, (ran, lines, taken, branches) in rooms.items():
    line_percent, branch_percent = 100 * ran / lines, 100 * taken / max(1, branches)
    short = short or line_percent < 92 or branch_percent < 80
    print(f"{room:16} {line_percent:7.1f}% {branch_percent:8.1f}%")
sys.exit("FAILED: less than 92 % of lines or 80 % of branches" if short else 0)
PYTHON
