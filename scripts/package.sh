#!/usr/bin/env bash
# Builds the Debian package: build/package/sixpoint_VERSION_ARCHITECTURE.deb. Works from a fresh clone
# on a fresh Debian 12 as root, and again.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/install_packages.sh build package
source scripts/build_environment.sh
if [ ! -f build/CMakeCache.txt ]; then
  configure release -DSIXPOINT_TESTS=OFF -DSIXPOINT_BENCH=OFF
fi
cmake --build build --target sixpoint sixpoint_package_files -- --quiet
rm -f build/package/*.deb
cpack --config build/CPackConfig.cmake >&2
ls build/package/*.deb
