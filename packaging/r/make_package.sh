#!/usr/bin/env bash
# Makes the source package of the R package, and prints its path. R is needed; the library it links to is named by
# SIXPOINT_R_LIBRARY when it is installed (build/r/lib).
#   make_package.sh SOURCE_FOLDER OUTPUT_FOLDER
set -euo pipefail
source_folder=$1 output=$2
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cp -r "$source_folder/bindings/r/sixpoint" "$scratch/sixpoint"
cp "$source_folder/bindings/r/calls.h" "$scratch/sixpoint/src/"
rmdir "$scratch/sixpoint/tests" 2>/dev/null || true
mkdir -p "$output"
cd "$output"
R CMD build --no-build-vignettes "$scratch/sixpoint" >"$scratch/log" 2>&1 || { cat "$scratch/log" >&2; exit 1; }
echo "$PWD"/sixpoint_*.tar.gz
