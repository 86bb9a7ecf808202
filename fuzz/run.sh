#!/usr/bin/env bash
# Builds the fuzz targets and runs each for its share of the time; ends with 1 at the first finding, whose input it
# names. Needs clang.
#   fuzz/run.sh [--seconds N | --hours N] [TARGET...]
# N: for all targets in sum (60 seconds without it). TARGET: gt3x_log ...; without one all that read recordings.
# What was learnt stays in build/fuzz/corpus and is the start of the next run; inputs that found something once are
# in fuzz/corpus/TARGET and run first.
set -euo pipefail
cd "$(dirname "$0")/.."
usage() { echo "usage: fuzz/run.sh [--seconds N | --hours N] [TARGET...]" >&2; exit 64; }
seconds=60
case "${1:-}" in
  --seconds) seconds=${2:?"--seconds needs a number"}; shift 2 ;;
  --hours) seconds=$((${2:?"--hours needs a number"} * 3600)); shift 2 ;;
  -*) usage ;;
esac
[[ $seconds =~ ^[0-9]+$ ]] || usage
targets=("$@")
if [ ${#targets[@]} -eq 0 ]; then
  for source in fuzz/gt3x_*.cpp fuzz/repair_*.cpp; do
    targets+=("$(basename "$source" .cpp)")
  done
fi

source scripts/build_environment.sh
configure fuzz
ninja -C build/fuzz ${SIXPOINT_BUILD_JOBS:+-j "$SIXPOINT_BUILD_JOBS"} "${targets[@]}" >/dev/null
python3 fuzz/make_corpus.py build/fuzz/seeds
share=$((seconds / ${#targets[@]}))
[ "$share" -gt 0 ] || share=1
for target in "${targets[@]}"; do
  mkdir -p "build/fuzz/corpus/$target" "build/fuzz/seeds/$target" "build/fuzz/findings"
  known=()
  [ -d "fuzz/corpus/$target" ] && known=("fuzz/corpus/$target")
  log=build/fuzz/$target.log
  if ! "build/fuzz/fuzz/$target" -max_total_time="$share" -timeout=10 -rss_limit_mb=1024 -max_len=20000 \
      -artifact_prefix="build/fuzz/findings/$target-" -print_final_stats=1 "build/fuzz/corpus/$target" \
      "build/fuzz/seeds/$target" "${known[@]}" >"$log" 2>&1; then
    tail -n 40 "$log"
    echo "$target: found something; the input is in build/fuzz/findings" >&2
    exit 1
  fi
  echo "$target: $(sed -n 's/stat::number_of_executed_units: *//p' "$log") runs in ${share} s, nothing found"
done
