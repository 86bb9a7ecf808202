#!/usr/bin/env bash
# Fails and names the files that clang-format would change. `scripts/check_format.sh --fix` changes them.
set -euo pipefail
cd "$(dirname "$0")/.."
mapfile -t files < <(git ls-files '*.cpp' '*.h')
if [ "${1:-}" = --fix ]; then
  clang-format -i "${files[@]}"
  exit 0
fi
if ! clang-format --dry-run --Werror "${files[@]}"; then
  echo "Run scripts/check_format.sh --fix" >&2
  exit 1
fi
echo "format: ${#files[@]} files checked"
