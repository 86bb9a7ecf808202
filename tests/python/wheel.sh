#!/usr/bin/env bash
# The wheel as its user has it: made, installed into an environment of its own, and used there.
#   wheel.sh SOURCE_FOLDER BINARY_FOLDER PYTHON
set -euo pipefail
. "$1/tests/python/prepare.sh" "$1" "$2" "$3" ensurepip numpy pandas
unset PYTHONPATH

wheel=$("$python" "$source_folder/packaging/python/make_wheel.py" "$binary_folder/python/sixpoint" "$scratch/made")
again=$("$python" "$source_folder/packaging/python/make_wheel.py" "$binary_folder/python/sixpoint" "$scratch/again")
cmp "$wheel" "$again"
"$python" -m venv --system-site-packages "$scratch/venv"
own=$scratch/venv/bin/python
if (cd "$scratch" && "$own" -c 'import sixpoint' 2>/dev/null); then
  echo "FAILED: sixpoint is there before it was installed"; exit 1
fi
"$own" -m pip install --quiet --no-index --no-deps --disable-pip-version-check "$wheel"
cd "$scratch"
place=$("$own" -c 'import sixpoint; print(sixpoint.__file__)')
case $place in
  "$scratch"/venv/*) ;;
  *) echo "FAILED: it was found at $place"; exit 1 ;;
esac
export PYTHONPATH=$source_folder/tests/python
"$own" -m unittest test_reading.Small test_files test_compat.Drop
"$own" -m pip uninstall --quiet --yes --disable-pip-version-check sixpoint
if "$own" -c 'import sixpoint' 2>/dev/null; then echo "FAILED: something is left of it"; exit 1; fi
