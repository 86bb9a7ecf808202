#!/usr/bin/env bash
# Runs the examples that are scripts over the program, as their README says.
#   run_example_scripts.sh SOURCE_FOLDER SIXPOINT_PROGRAM PYTHON
set -euo pipefail
source_folder=$1 python=$3
export SIXPOINT_PROGRAM=$2
"$python" -c 'import pytest' 2>/dev/null ||
  { "$source_folder/tests/skip.sh" "pytest is missing; install python3-pytest"; exit $?; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export HOME=$scratch PYTHONDONTWRITEBYTECODE=1
cd "$scratch"
"$python" -m pytest -q -p no:cacheprovider "$source_folder/examples/recorded-session"

# A printer that takes one label.
"$python" - >port.txt <<'PY' &
import pathlib
import socket

with socket.create_server(("127.0.0.1", 0)) as server:
    server.settimeout(60)
    print(server.getsockname()[1], flush=True)
    connection, _ = server.accept()
    with connection:
        label = b""
        while block := connection.recv(65536):
            label += block
pathlib.Path("printed.zpl").write_bytes(label)
PY
printer=$!
until [ -s port.txt ]; do sleep 0.1; done
"$source_folder/examples/station-limits/run.sh" virtual:seed=7,jig=auto 127.0.0.1 "$(cat port.txt)" >run.txt 2>&1 ||
  { cat run.txt; exit 1; }
wait "$printer"
grep -q '^high = 5' limits.toml
grep -qF '^XA' printed.zpl || { echo "FAILED: no label was printed"; exit 1; }
echo "the label was printed: $(wc -c <printed.zpl) bytes"
