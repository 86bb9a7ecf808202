#!/usr/bin/env bash
# Makes the source package of the R package, and prints its path. Its examples and its vignette use a recording that
# the program simulates here; the vignette is woven with the package that is being made.
#   make_package.sh SOURCE_FOLDER BINARY_FOLDER OUTPUT_FOLDER     needs the targets sixpoint and sixpoint_r
set -euo pipefail
source_folder=$(realpath "$1") binary_folder=$(realpath "$2") output=$3
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cp -r "$source_folder/bindings/r/sixpoint" "$scratch/sixpoint"
cp "$source_folder/bindings/r/calls.h" "$scratch/sixpoint/src/"
rmdir "$scratch/sixpoint/tests" 2>/dev/null || true
mkdir -p "$output" "$scratch/sixpoint/inst/extdata"
"$binary_folder/sixpoint" simulate --scenario "$source_folder/packaging/r/unit.json" \
  -o "$scratch/sixpoint/inst/extdata/unit.gt3x" >"$scratch/log" 2>&1 || { cat "$scratch/log" >&2; exit 1; }
cd "$output"
SIXPOINT_R_LIBRARY=$binary_folder/r/lib R CMD build "$scratch/sixpoint" >"$scratch/log" 2>&1 ||
  { cat "$scratch/log" >&2; exit 1; }
echo "$PWD"/sixpoint_*.tar.gz
