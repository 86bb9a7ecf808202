#!/usr/bin/env bash
# Installs the mocks into an empty prefix, then configures, builds and runs the example project
# against it, with nothing of the source tree in sight.
#   example_project.sh CMAKE BUILD_FOLDER EXAMPLE_FOLDER COMPILER
set -euo pipefail
cmake=$1 build_folder=$2 example=$3 compiler=$4
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
for component in dev mocks; do
  "$cmake" --install "$build_folder" --component $component --prefix "$scratch/prefix" >"$scratch/log" 2>&1 ||
    { cat "$scratch/log"; exit 1; }
done
cp -r "$example" "$scratch/example"
flags=""
# Rooms that were built with the sanitizers need their run-time libraries.
if grep -q '^SIXPOINT_SANITIZE:BOOL=ON' "$build_folder/CMakeCache.txt"; then
  flags="-fsanitize=address,undefined"
fi
"$cmake" -S "$scratch/example" -B "$scratch/build" -DCMAKE_PREFIX_PATH="$scratch/prefix" \
  -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_CXX_FLAGS="$flags" -DCMAKE_BUILD_TYPE=Release
"$cmake" --build "$scratch/build"
"$scratch/build/driver_test"
# What is installed names no folder of the machine it was built on.
if grep -rIl "$build_folder" "$scratch/prefix"; then
  echo "FAILED: the package names its build folder"
  exit 1
fi
