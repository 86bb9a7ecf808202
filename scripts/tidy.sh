#!/usr/bin/env bash
# clang-tidy over the program's sources, on every core: those that differ, in themselves or in what they include of the
# project, from what scripts/tidy.stamp names as clean, or the machine's own list of what was checked since.
#   scripts/tidy.sh [--within SECONDS] [--stamp] [FILE...]     needs build/, built
# --within starts no file after that time; files that are left then are a failure. --stamp writes scripts/tidy.stamp
# anew: what is clean of the files as they are now.
set -euo pipefail
cd "$(dirname "$0")/.."
within=0 write_stamp=0
while :; do
  case ${1:-} in
    --within) within=${2:?"--within needs seconds"}; shift 2 ;;
    --stamp) write_stamp=1; shift ;;
    *) break ;;
  esac
done
checked=${XDG_CACHE_HOME:-$HOME/.cache}/sixpoint-tidy
mkdir -p "$checked"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
scripts/tidy_digests.py "$@" >"$work/all"
not_clean() {  # lines of "digest file"
  while read -r digest file; do
    if ! grep -qsx "$digest" scripts/tidy.stamp && [ ! -e "$checked/$digest" ]; then echo "$digest $file"; fi
  done <"$work/all"
}
not_clean >"$work/asked"

status=0
if [ -s "$work/asked" ]; then
  # Every file by itself.
  source scripts/build_environment.sh
  configure release -B build/tidy -DSIXPOINT_UNITY=OFF -DSIXPOINT_TESTS=OFF
  cp -r build/generated build/tidy/
  end=$((within > 0 ? $(date +%s) + within : 0))
  check_one() {
    if [ "$end" -gt 0 ] && [ "$(date +%s)" -ge "$end" ]; then return 0; fi
    clang-tidy --quiet -p build/tidy "$2" 2>/dev/null && touch "$checked/$1"
  }
  export -f check_one
  export checked end
  tr ' \n' '\0\0' <"$work/asked" | xargs -0 -n 2 -P "$(nproc)" bash -c 'check_one "$@"' _ || status=1
fi
not_clean >"$work/left"
if [ "$write_stamp" = 1 ]; then
  grep -vxFf "$work/left" "$work/all" | cut -d' ' -f1 | sort >scripts/tidy.stamp
fi
asked=$(wc -l <"$work/asked") left=$(wc -l <"$work/left")
echo "clang-tidy: $(($(wc -l <"$work/all") - left)) files are clean; $((asked - left)) of them were checked now"
if [ "$left" -gt 0 ] && [ "$status" = 0 ]; then
  echo "FAILED: not checked, because the time was over; run 'scripts/tidy.sh --stamp' and commit scripts/tidy.stamp:"
  cut -d' ' -f2 "$work/left"
  status=1
fi
exit "$status"
