#!/usr/bin/env bash
# Makes the pictures of the documents anew, in docs/pictures: the station's page as its test in a browser sees it, and
# the page that a diagnosis draws. Needs build/, built.
set -euo pipefail
cd "$(dirname "$0")/.."
program=$PWD/build/sixpoint pictures=$PWD/docs/pictures
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
mkdir -p "$pictures"
tests/page/run.sh whole "$program" "$scratch"
cp "$scratch/whole-2-measuring.png" "$pictures/station-measuring.png"
cp "$scratch/whole-4-written.png" "$pictures/station-written.png"
cp "$scratch/whole-5-today.png" "$pictures/station-today.png"
cd "$scratch"
cat >bundle.json <<'JSON'
{"schema": "sixpoint/scenario/1", "seed": 11, "protocol": "engineering",
 "effects": [{"name": "tilt"}, {"name": "drift"}, {"name": "second_order"}]}
JSON
"$program" simulate --scenario bundle.json -o bundle
"$program" gap diagnose bundle --png "$pictures/diagnosis.png" >/dev/null
