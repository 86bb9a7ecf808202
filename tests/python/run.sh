#!/usr/bin/env bash
# Runs one file of tests of the Python package.
#   run.sh SOURCE_FOLDER BINARY_FOLDER PYTHON test_NAME.py
set -euo pipefail
source_folder=$1
binary_folder=$2
python=$3
skip=$source_folder/tests/skip.sh
compgen -G "$binary_folder/python/sixpoint/_core*.so" >/dev/null ||
  { "$skip" "the Python package was not built; install pybind11-dev and python3-dev"; exit $?; }
for module in numpy pandas matplotlib; do
  "$python" -c "import $module" 2>/dev/null ||
    { "$skip" "python3-$module is missing; install it"; exit $?; }
done
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export PYTHONPATH=$binary_folder/python:$source_folder/tests/python PYTHONDONTWRITEBYTECODE=1
export SIXPOINT_PROGRAM=$binary_folder/sixpoint SIXPOINT_SOURCE=$source_folder
export SIXPOINT_SHARED=${SIXPOINT_SHARED:-$source_folder/../shared} HOME=$scratch MPLCONFIGDIR=$scratch
cd "$scratch"
"$python" -W error::DeprecationWarning -m unittest -v "${4%.py}"
