#!/usr/bin/env bash
# The main job from beginning to end, without hardware: a virtual unit of 2013 is measured on the jig, and
# its archive is scanned and repaired. The results are in build/demo. It takes a few seconds after the
# build.
#   demo.sh                            builds, and does all of it
#   demo.sh --archive PROGRAM FOLDER   makes the archive alone, in FOLDER/archive
set -euo pipefail
if [ "${1:-}" = --archive ]; then
  sixpoint=$2
  out=$3
else
  cd "$(dirname "$0")/.."
  scripts/build.sh
  sixpoint=$PWD/build/sixpoint
  out=$PWD/build/demo
  rm -rf "$out"
fi
shared=${SIXPOINT_SHARED:-$PWD/../shared}
mkdir -p "$out/scenarios" "$out/archive" "$out/truth"
store=$out/store.db

say() { printf '\n\033[1m%s\033[0m\n' "$*"; }
# Runs a command that must end with the given exit code. 1 means "affected", which is expected here.
expect() {
  local wanted=$1 got=0
  shift
  "$@" || got=$?
  if [ "$got" -ne "$wanted" ]; then
    echo "demo: '$*' ended with $got instead of $wanted" >&2
    exit 70
  fi
}

# The unit: what its memory holds (constants of 2013, measured under the legacy filter configuration)
# and the true constants of its sensor under the current one.
serial=MOS2A45130007
positive='[311, 310, 287]' negative='[-204, -216, -234]' zero='[54, 47, 26]'
sensitivity='[237.7, 251.8, 242.3]' sensor_zero='[49.9, 95.8, 60.8]'
noise='[3.9, 3.9, 5.5]'

# scenario NAME FIRMWARE START MOTION_SEED
scenario() {
  cat >"$out/scenarios/$1.json" <<JSON
{
  "schema": "sixpoint/scenario/1",
  "seed": $4,
  "unit": {
    "serial": "$serial", "firmware": "$2", "calibrated": "2013-11-12T14:32:13Z",
    "constants": {"positive_lsb": $positive, "negative_lsb": $negative, "zero_lsb": $zero},
    "sensor": {"current": {"sensitivity_lsb_per_g": $sensitivity, "zero_lsb": $sensor_zero}},
    "noise_mg": $noise
  },
  "start": "$3",
  "rate_hz": 30,
  "motions": [
    {"kind": "still", "duration_s": 120, "pose": "+z"},
    {"kind": "shaker", "duration_s": 60, "direction_lab": [1, 0, 0], "frequency_hz": 2, "amplitude_g": 0.8},
    {"kind": "free_living", "seed": $4, "duration_s": 3600},
    {"kind": "still", "duration_s": 60, "pose": "-x"}
  ]
}
JSON
}

say "1. A unit of 2013 and its archive: three recordings under firmware 1.5.0, one each under 1.2.0 and 1.8.0"
scenario day1 1.5.0 2015-04-09T14:04:00Z 11
scenario day2 1.5.0 2015-04-10T08:00:00Z 12
scenario day3 1.5.0 2015-04-11T08:00:00Z 13
scenario before 1.2.0 2014-06-01T08:00:00Z 14
scenario after 1.8.0 2016-06-01T08:00:00Z 15
for name in day1 day2 day3 before after; do
  "$sixpoint" simulate --scenario "$out/scenarios/$name.json" -o "$out/archive/$name.gt3x" \
    --truth "$out/truth/$name.csv"
done
if [ "${1:-}" = --archive ]; then exit; fi
# A good unit that was moved together with it on day1, for the pictures (paper, Figures 4-6).
sed -e "s/$serial/MOS2C01150042/; s/2013-11-12/2015-01-12/; /\"constants\"/d; /\"sensor\"/d" \
  -e 's/"unit": {/"unit": { "seed": 42,/' \
  "$out/scenarios/day1.json" >"$out/scenarios/sound.json"
"$sixpoint" simulate --scenario "$out/scenarios/sound.json" -o "$out/sound.gt3x"

say "2. Which files are affected? (three are, two are not)"
expect 1 "$sixpoint" scan "$out/archive"

say "3. The unit on the jig, under the current filter configuration"
"$sixpoint" jig --store "$store" --operator demo --station bench-1 --filter current --device \
  "virtual:seed=7,serial=$serial,firmware=1.5.0,calibrated=2013-11-12,positive_lsb=311/310/287,negative_lsb=-204/-216/-234,zero_lsb=54/47/26,true_sensitivity_lsb_per_g=237.7/251.8/242.3,true_zero_lsb=49.9/95.8/60.8,jig=auto"
"$sixpoint" history "$serial" --store "$store"

say "4. The archive is repaired; the originals are not changed"
(cd "$out/archive" && sha256sum ./*.gt3x) >"$out/originals.sha256"
"$sixpoint" repair "$out/archive" -o "$out/repaired" --store "$store" --json >"$out/repair.json"
(cd "$out/archive" && sha256sum --quiet -c "$out/originals.sha256")
echo "originals: unchanged"

# RMS difference in mg between the stored samples and the truth, over all samples and axes.
rms_mg() {
  "$sixpoint" export "$1" --raw --no-fill --csv - |
    awk -F, -v truth="$2" '
      $1 !~ /^-?[0-9]+$/ { next }
      {
        do { if ((getline line < truth) <= 0) { print "truth ends early" > "/dev/stderr"; exit 1 } } while (line !~ /^[0-9]/)
        split(line, t, ",")
        for (a = 1; a <= 3; ++a) { d = $a / 256 - t[a + 1]; s += d * d; ++n }
      }
      END { printf "%.3f", 1000 * sqrt(s / n) }'
}
# The least RMS that is possible: sensor noise, the counts of the sensor and one rounding to 1/256 g
# (closed form).
floor_mg=$(awk -v noise="$noise" -v sensitivity="$sensitivity" 'BEGIN {
  gsub(/[][ ]/, "", noise); gsub(/[][ ]/, "", sensitivity)
  split(noise, n, ","); split(sensitivity, k, ",")
  for (a = 1; a <= 3; ++a) s += n[a] ^ 2 + (1000 / k[a]) ^ 2 / 12 + (1000 / 256) ^ 2 / 12
  printf "%.3f", sqrt(s / 3) }')

say "5. Before and after"
field() { # FILE KEY... of repair.json, without a JSON tool: one file's block
  awk -v file="/$1.gt3x\"" -v key="\"$2\"" '
    index($0, "\"input\"") { mine = index($0, file) > 0 }
    mine && index($0, key) { sub(/.*: /, ""); sub(/,.*/, ""); print; exit }' "$out/repair.json"
}
printf '%-8s | %-26s | %-30s | %s\n' file "still error, mg" "RMS against the truth, mg" "RMS / floor of $floor_mg mg"
failed=0
for name in day1 day2 day3; do
  still_before=$(field "$name" before) still_after=$(field "$name" after)
  before=$(rms_mg "$out/archive/$name.gt3x" "$out/truth/$name.csv")
  after=$(rms_mg "$out/repaired/$name.gt3x" "$out/truth/$name.csv")
  ratio=$(awk -v a="$after" -v f="$floor_mg" 'BEGIN { printf "%.3f", a / f }')
  printf '%-8s | %8.1f -> %-14.2f | %8.1f -> %-18.2f | %s\n' \
    "$name" "$still_before" "$still_after" "$before" "$after" "$ratio"
  awk -v sb="$still_before" -v sa="$still_after" -v r="$ratio" \
    'BEGIN { exit !(sb > 100 && sa < 5 && r <= 1.1) }' || failed=1
done
if [ "$failed" -ne 0 ]; then
  echo "demo: a figure is out of its bounds (before > 100 mg, after < 5 mg, RMS <= 1.1 of the floor)" >&2
  exit 70
fi

say "6. Pictures: the affected unit, a good one beside it, and the repaired data"
"$sixpoint" compare "$out/archive/day1.gt3x" "$out/sound.gt3x" "$out/repaired/day1.gt3x" \
  --html "$out/report.html"

say "7. Two real affected units"
real=$shared/data/wgt3x-bt-affected
if [ -d "$real" ]; then
  expect 1 "$sixpoint" scan "$real"
  for file in "$real"/*.gt3x; do
    echo
    "$sixpoint" solve "$file" || true # every verdict is an answer here
  done
else
  echo "SKIPPED: $real is not there; set SIXPOINT_SHARED to the folder with the recordings"
fi

say "Done. The report is $out/report.html, the store $store"
