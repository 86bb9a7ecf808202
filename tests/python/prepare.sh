# Sourced by the tests of the Python package, with SOURCE_FOLDER BINARY_FOLDER PYTHON MODULE...: ends as skipped where
# something is missing, and makes a folder of the test's own that is its home.
source_folder=$1 binary_folder=$2 python=$3
skip=$source_folder/tests/skip.sh
compgen -G "$binary_folder/python/sixpoint/_core*.so" >/dev/null ||
  { "$skip" "the Python package was not built; install pybind11-dev and python3-dev"; exit $?; }
for module in "${@:4}"; do
  "$python" -c "import $module" 2>/dev/null ||
    { "$skip" "$python has no $module; scripts/install_packages.sh python installs it"; exit $?; }
done
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export HOME=$scratch PYTHONDONTWRITEBYTECODE=1
export SIXPOINT_PROGRAM=$binary_folder/sixpoint SIXPOINT_SOURCE=$source_folder
export SIXPOINT_SHARED=${SIXPOINT_SHARED:-$source_folder/../shared}
