#!/usr/bin/env bash
# The R package from its source package: checked, installed into a library of its own, used there.
#   run.sh SOURCE_FOLDER BINARY_FOLDER
set -euo pipefail
source_folder=$1 binary_folder=$2
skip=$source_folder/tests/skip.sh
command -v Rscript >/dev/null || { "$skip" "R is missing; install r-base-dev"; exit $?; }
Rscript -e 'library(jsonlite)' 2>/dev/null || { "$skip" "install r-cran-jsonlite"; exit $?; }
Rscript -e 'library(knitr); library(markdown)' 2>/dev/null || { "$skip" "install r-cran-knitr r-cran-markdown"; exit $?; }
[ -f "$binary_folder/r/lib/libsixpoint_r.a" ] || { "$skip" "build the target sixpoint_r"; exit $?; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export HOME=$scratch SIXPOINT_R_LIBRARY=$binary_folder/r/lib R_LIBS_USER=$scratch/library
export SIXPOINT_PROGRAM=$binary_folder/sixpoint SIXPOINT_SOURCE=$source_folder
export SIXPOINT_SHARED=${SIXPOINT_SHARED:-$source_folder/../shared}
mkdir "$scratch/library" "$scratch/work"
cd "$scratch"
# With a relative name, as scripts/package.sh gives it.
package=$(cd "$(dirname "$binary_folder")" && "$source_folder/packaging/r/make_package.sh" "$source_folder" "$(basename "$binary_folder")" "$scratch/made")
# Clean: no error, no warning, no note. What needs a network or TeX is left out.
R CMD check --no-manual "$package" >check.log 2>&1 || { cat check.log; exit 1; }
grep '^Status: OK$' check.log >/dev/null || { cat check.log; exit 1; }
R CMD INSTALL --library="$scratch/library" "$package" >install.log 2>&1 || { cat install.log; exit 1; }
unset SIXPOINT_R_LIBRARY
mkdir other
R CMD INSTALL --library=other "$package" >without.log 2>&1 && { echo "FAILED: installed without its library"; exit 1; }
grep -q '^SIXPOINT_R_LIBRARY to its build/r/lib$' without.log || { cat without.log; exit 1; }
cd work
for seed in 1 2; do
  sed "s/\"seed\": 1/\"seed\": $seed/" "$source_folder/tests/docs/scenario.json" >"s$seed.json"
  "$SIXPOINT_PROGRAM" simulate --scenario "s$seed.json" -o "day$seed.gt3x" >/dev/null 2>&1
done
PYTHONPATH=$source_folder/tests/python python3 -c '
from made import *
many_gaps(".")
def with_calibration(name, kind, calibration, scale="256.0"):
    info = INFO.replace("Rate: 30", "Rate: 32").replace("Scale: 256.0", f"Scale: {scale}")
    write_recording(name, record(kind, START, packed([(0, 0, 256)] * 32)), info)
    with zipfile.ZipFile(name, "a") as archive:
        archive.writestr("calibration.json", json.dumps(calibration))
matrix = {"calibrationMethod": 2, "isCalibrated": False}
for axis in "XYZ":
    matrix |= {f"offset{axis}_32": 1, f"sensitivity{axis}{axis}_32": 25600}
matrix |= {f"sensitivity{axes}_32": 0 for axes in ("XY", "XZ", "YZ")}
with_calibration("scaled.gt3x", 0, matrix)
with_calibration("calibrated.agdc", 27, matrix | {"isCalibrated": True})
with_calibration("in_g.agdc", 27, {"isCalibrated": True})
with_calibration("raw.agdc", 27, matrix, "1")
write_recording("undated.gt3x", record(0, START, packed(samples_of(0))), INFO.replace("Start Date: 635641850400000000\r\n", ""))
write_recording("twice.gt3x", record(0, START, packed(samples_of(0))), INFO + "TimeZone: 01:00:00\r\n")'
Rscript "$source_folder/tests/r/package_test.R"
# Ctrl-C ends a call: the loop is left by nothing else.
for call in scan_16cpan03 read_gt3x_sixpoint; do
  # Made empty here and not by the program that starts: the loop below could read what the last one wrote.
  : >out.txt
  Rscript -e "library(sixpoint); tryCatch({ cat('begins\n'); repeat $call('day1.gt3x') }, interrupt = function(i) cat('interrupted\n'))" >>out.txt &
  child=$!
  until grep -q begins out.txt; do sleep 0.1; done
  sleep 0.3
  kill -INT "$child"
  wait "$child" || true
  grep -q interrupted out.txt || { echo "FAILED: Ctrl-C did not end $call"; cat out.txt; exit 1; }
done
# The examples of docs/r.md, in order, with unit.gt3x in the folder.
cp day1.gt3x unit.gt3x
awk '/^```r$/ { inside = 1; next } /^```/ { inside = 0 } inside' "$source_folder/docs/r.md" >snippets.R
[ "$(wc -l <snippets.R)" -gt 8 ]
Rscript snippets.R >snippets.log 2>&1 || { cat snippets.log; exit 1; }
mkdir archive && cp day1.gt3x day2.gt3x archive
Rscript "$source_folder/examples/r/find_and_repair.R" archive repaired >example.log 2>&1 || { cat example.log; exit 1; }
grep -q '2 of 2 files are affected' example.log
[ -s repaired/day1.png ] && [ -s repaired/day2.png ]
