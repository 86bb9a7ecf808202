#!/usr/bin/env bash
# Fails and names the files that clang-format would change. `scripts/check_format.sh --fix` changes them.
set -euo pipefail
cd "$(dirname "$0")/.."
list=$(git ls-files '*.cpp' '*.h')  # not in <(...), whose failure would pass unseen
[ -n "$list" ] || { echo "git knows no file to check" >&2; exit 1; }
mapfile -t files <<<"$list"
if [ "${1:-}" = --fix ]; then
  clang-format -i "${files[@]}"
  exit 0
fi
if ! clang-format --dry-run --Werror "${files[@]}"; then
  echo "Run scripts/check_format.sh --fix" >&2
  exit 1
fi
echo "format: ${#files[@]} files checked"
