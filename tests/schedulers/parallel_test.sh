#!/usr/bin/env bash
# The shards of an archive by GNU parallel, as docs/archive.md prints it.
#   parallel_test.sh SOURCE_FOLDER SIXPOINT_PROGRAM
set -euo pipefail
command -v parallel >/dev/null && parallel --version 2>/dev/null | grep -q GNU ||
  exec "$1/tests/skip.sh" "no GNU parallel; install parallel"
source "$1/tests/schedulers/archive.sh"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
make_archive "$scratch/data" "$1/tests/docs/scenario.json" "$2"
data=$scratch/data
"$2" archive plan "$data/archive" -o "$data/plan" --store "$data/store.db" --shards 6 >/dev/null 2>&1
run() {
  parallel --will-cite --halt never --joblog "$scratch/log" -j 3 \
    "$2" archive run "$data/plan" --shard '{}' -o "$data/out" ::: $(seq 0 5) >/dev/null 2>&1
}
run "$@" || { echo "FAILED: a shard failed"; cat "$scratch/log"; exit 1; }
run "$@" || { echo "FAILED: done shards run again"; exit 1; }
"$2" archive merge "$data/plan" >/dev/null 2>&1 || { echo "FAILED: the archive is not complete"; exit 1; }
compare_with_one_repair "$data/out"
echo "six shards by parallel: the same $repaired files as one repair"
