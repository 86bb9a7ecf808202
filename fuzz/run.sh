#!/usr/bin/env bash
# Builds the fuzz targets (with the sanitized tests, in build/sanitize) and runs each for its share of the time, as many at
# a time as there are cores; ends with 1 when one found something, whose input it names. Needs clang.
#   fuzz/run.sh [--seconds N | --hours N] [TARGET...]
# N: for all of them together (60 seconds without it). TARGET: gt3x_log ...; without one all that there are.
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
  for source in fuzz/*_*.cpp; do
    targets+=("$(basename "$source" .cpp)")
  done
fi

source scripts/build_environment.sh
configure sanitize
ninja -C build/sanitize ${SIXPOINT_BUILD_JOBS:+-j "$SIXPOINT_BUILD_JOBS"} "${targets[@]}" >/dev/null
mkdir -p build/fuzz/findings
python3 fuzz/make_corpus.py build/fuzz/seeds
# What the program writes is the start of the targets that read devices, stores and bundles.
if [ -x build/sixpoint ]; then
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  echo '{"schema": "sixpoint/scenario/1", "seed": 3, "protocol": "production"}' >"$work/scenario.json"
  {
    build/sixpoint jig --device virtual:seed=1,jig=auto --record "$work/session.zip" --store "$work/bench.db" &&
      build/sixpoint store export --store "$work/bench.db" -o "$work/store.jsonl" &&
      build/sixpoint simulate --scenario "$work/scenario.json" -o "$work/bundle"
  } >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
  python3 fuzz/make_seeds.py "$work" build/fuzz/seeds
fi

share=$((seconds * $(nproc) / ${#targets[@]}))
[ "$share" -gt 0 ] || share=1
run_one() {
  local target=$1 log=build/fuzz/$1.log known=()
  mkdir -p "build/fuzz/corpus/$target" "build/fuzz/seeds/$target"
  [ -d "fuzz/corpus/$target" ] && known=("fuzz/corpus/$target")
  if ! "build/sanitize/fuzz/$target" -max_total_time="$share" -timeout=30 -rss_limit_mb=1024 -max_len=30000 \
      -artifact_prefix="build/fuzz/findings/$target-" -print_final_stats=1 "build/fuzz/corpus/$target" \
      "build/fuzz/seeds/$target" "${known[@]}" >"$log" 2>&1; then
    tail -n 40 "$log"
    echo "$target: found something; the input is in build/fuzz/findings" >&2
    return 1
  fi
  echo "$target: $(sed -n 's/stat::number_of_executed_units: *//p' "$log") runs in $share s, nothing found"
}
export -f run_one
export share
printf '%s\0' "${targets[@]}" | xargs -0 -n 1 -P "$(nproc)" bash -c 'run_one "$1"' _ || exit 1
