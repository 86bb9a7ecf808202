#!/usr/bin/env bash
# clang-tidy over the program's sources, on every core. A clean file is not checked again until it, a file
# that it includes, or .clang-tidy changes.
#   scripts/tidy.sh [--within SECONDS] [FILE...]     needs build/, built
# --within begins with the last changes, starts no file after that time, and lists the files that are left.
set -euo pipefail
cd "$(dirname "$0")/.."
within=0
if [ "${1:-}" = --within ]; then
  within=${2:?"--within needs seconds"}
  shift 2
fi
cache=${XDG_CACHE_HOME:-$HOME/.cache}/sixpoint-tidy
mkdir -p "$cache"
if [ $# -gt 0 ]; then
  files=("$@")
else
  mapfile -t files < <(git ls-files 'base/*.cpp' 'gt3x/*.cpp' 'calib/*.cpp' 'sim/*.cpp' \
    'device/*.cpp' 'mocks/*.cpp' 'db/*.cpp' 'repair/*.cpp' 'gap/*.cpp' 'station/*.cpp' 'cli/*.cpp' \
    'packaging/*.cpp' 'bindings/*.cpp')
  # In the order of their last change; a clone without history leaves the order as it is.
  mapfile -t files < <({ git log --name-only --diff-filter=d --pretty=format: -n 400 -- '*.cpp'
                         printf '%s\n' "${files[@]}"; } |
    awk 'NR == FNR { known[$0]; next } ($0 in known) && !seen[$0]++' \
      <(printf '%s\n' "${files[@]}") -)
fi
# Every file by itself, and without g++'s precompiled headers, which clang does not read.
source scripts/build_environment.sh
configure release -B build/tidy -DSIXPOINT_UNITY=OFF -DSIXPOINT_TESTS=OFF -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON
cp -r build/generated build/tidy/
left=$(mktemp)
trap 'rm -f "$left"' EXIT

check_one() {
  local file=$1 command key
  if [ "$within" -gt 0 ] && [ "$SECONDS_AT_START" -le "$(($(date +%s) - within))" ]; then
    echo "$file" >>"$left"
    return 0
  fi
  # The command line that compiles this file, without its output and its launcher.
  command=$(python3 - "$file" <<'PY'
import json, os, shlex, sys
wanted = os.path.realpath(sys.argv[1])
for entry in json.load(open("build/tidy/compile_commands.json")):
    if os.path.realpath(os.path.join(entry["directory"], entry["file"])) == wanted:
        words = shlex.split(entry["command"])
        keep, skip = [], False
        for word in words:
            if skip:
                skip = False
            elif word == "-o":
                skip = True
            elif not word.endswith("ccache") and word != "-c":
                keep.append(word)
        print(entry["directory"])
        print(shlex.join(keep))
        break
PY
)
  if [ -z "$command" ]; then
    echo "tidy: $file is in no target" >&2
    return 1
  fi
  key=$( (cat .clang-tidy; cd "$(head -n 1 <<<"$command")" && eval "$(tail -n 1 <<<"$command") -E -P") |
        sed "s|$PWD||g" | sha256sum | cut -d' ' -f1)
  [ -e "$cache/$key" ] && return 0
  if clang-tidy --quiet -p build/tidy "$file" 2>/dev/null; then
    touch "$cache/$key"
  else
    return 1
  fi
}
export -f check_one
export cache within left
SECONDS_AT_START=$(date +%s)
export SECONDS_AT_START
printf '%s\0' "${files[@]}" | xargs -0 -n 1 -P "$(nproc)" bash -c 'check_one "$1"' _
echo "clang-tidy: $((${#files[@]} - $(wc -l <"$left"))) of ${#files[@]} files checked"
if [ -s "$left" ]; then
  echo "Not checked, because the time was over; 'scripts/tidy.sh' checks them all:"
  cat "$left"
fi
