#!/usr/bin/env bash
# Builds the program: build/sixpoint. Works from a fresh clone on a fresh Debian 12 as root, and again.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/install_packages.sh build
source scripts/build_environment.sh
# Tests and benchmarks need more packages (scripts/test.sh); a build folder that has them is left as it is.
if [ ! -f build/CMakeCache.txt ]; then
  configure release -DSIXPOINT_TESTS=OFF -DSIXPOINT_BENCH=OFF
fi
cmake --build build --target sixpoint -- --quiet
echo "build/sixpoint is ready: $(build/sixpoint --version)" >&2
