#!/usr/bin/env bash
# Makes the Debian packages, for the tests beside it.
#   make.sh CPACK BUILD_FOLDER SOURCE_FOLDER PACKAGES_FOLDER
set -euo pipefail
cpack=$1 build_folder=$2 source_folder=$3 made=$4
command -v dpkg-shlibdeps >/dev/null || { "$source_folder/tests/skip.sh" "the package needs dpkg-shlibdeps"; exit $?; }
rm -rf "$made"
"$cpack" --config "$build_folder/CPackConfig.cmake" -B "$made"
