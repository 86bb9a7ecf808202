#!/usr/bin/env bash
# Measures a unit by limits of this station, and prints its label.
#   run.sh DEVICE PRINTER_HOST PRINTER_PORT        for example: run.sh virtual:seed=7,jig=auto label-printer 9100
set -euo pipefail
device=${1:?'usage: run.sh DEVICE PRINTER_HOST PRINTER_PORT'} printer=${2:?} port=${3:?}
program=${SIXPOINT_PROGRAM:-sixpoint}

# Once for a station: the built-in limits, with one that is tighter.
if [ ! -e limits.toml ]; then
  "$program" limits print >limits.toml
  sed -i '/^\[verification_residual_mg\]/,/^\[/ s/^high = .*/high = 5/' limits.toml
fi
"$program" limits check limits.toml

# For each unit. The label is made only when what the unit holds was read back and passed. It is in a folder of its own: one
# that could not be printed is not in the way of the next.
labels=$(mktemp -d)
trap 'rm -rf "$labels"' EXIT
"$program" jig --device "$device" --limits limits.toml --store station.db --station bench-3 --write --label "$labels/label.zpl"
cat "$labels/label.zpl" >"/dev/tcp/$printer/$port"
