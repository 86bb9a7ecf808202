#!/usr/bin/env bash
# Breaks named places of the program one at a time; the tests must notice each (README.md).
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
exec python3 "$here/run.py" "$@"
