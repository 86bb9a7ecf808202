#!/usr/bin/env bash
# Runs one file of tests of the Python package.
#   run.sh SOURCE_FOLDER BINARY_FOLDER PYTHON test_NAME.py
set -euo pipefail
. "$1/tests/python/prepare.sh" "$1" "$2" "$3" numpy pandas matplotlib
export PYTHONPATH=$binary_folder/python:$source_folder/tests/python MPLCONFIGDIR=$scratch
cd "$scratch"
"$python" -W error::DeprecationWarning -m unittest -v "${4%.py}"
