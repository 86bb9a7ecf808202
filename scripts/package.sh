#!/usr/bin/env bash
# Builds packages into build/package. Works from a fresh clone on a fresh Debian 12 as root, and again.
#   scripts/package.sh             the Debian packages: program, station, development, mocks (packaging/README.md)
#   scripts/package.sh --python    the Python package: sixpoint-VERSION-cp311-cp311-linux_x86_64.whl
#   scripts/package.sh --r         the R package: sixpoint_VERSION.tar.gz, and build/r/lib, which it links to
set -euo pipefail
cd "$(dirname "$0")/.."
kind=${1:-deb}
case $kind in
  deb) scripts/install_packages.sh build package ;;
  --python) scripts/install_packages.sh build python ;;
  --r) scripts/install_packages.sh build r ;;
  *) echo "usage: scripts/package.sh [--python | --r]" >&2; exit 64 ;;
esac
source scripts/build_environment.sh
if [ ! -f build/CMakeCache.txt ]; then
  configure release -DSIXPOINT_TESTS=OFF -DSIXPOINT_BENCH=OFF
fi
if [ "$kind" = --python ]; then
  cmake --build build --target sixpoint_python -- --quiet
  rm -f build/package/*.whl
  /usr/bin/python3 packaging/python/make_wheel.py build/python/sixpoint build/package
  exit
fi
if [ "$kind" = --r ]; then
  cmake --build build --target sixpoint sixpoint_r -- --quiet
  packaging/r/make_package.sh "$PWD" build build/package
  exit
fi
cmake --build build --target sixpoint sixpoint_package_files -- --quiet
rm -f build/package/*.deb
cpack --config build/CPackConfig.cmake >&2
ls build/package/*.deb
