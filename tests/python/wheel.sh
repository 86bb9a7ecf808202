#!/usr/bin/env bash
# The wheel as its user has it: made, installed into an environment of its own, and used there.
#   wheel.sh SOURCE_FOLDER BINARY_FOLDER PYTHON
set -euo pipefail
source_folder=$1 binary_folder=$2 python=$3
skip=$source_folder/tests/skip.sh
compgen -G "$binary_folder/python/sixpoint/_core*.so" >/dev/null ||
  { "$skip" "the Python package was not built; install pybind11-dev and python3-dev"; exit $?; }
for module in ensurepip numpy pandas; do
  "$python" -c "import $module" 2>/dev/null ||
    { "$skip" "$python has no $module; install python3-venv python3-numpy python3-pandas"; exit $?; }
done
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
unset PYTHONPATH
export HOME=$scratch

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
export SIXPOINT_PROGRAM=$binary_folder/sixpoint SIXPOINT_SOURCE=$source_folder PYTHONPATH=$source_folder/tests/python
export SIXPOINT_SHARED=${SIXPOINT_SHARED:-$source_folder/../shared} PYTHONDONTWRITEBYTECODE=1
"$own" -m unittest test_reading.Small test_files test_compat.Drop
"$own" -m pip uninstall --quiet --yes --disable-pip-version-check sixpoint
if "$own" -c 'import sixpoint' 2>/dev/null; then echo "FAILED: something is left of it"; exit 1; fi
