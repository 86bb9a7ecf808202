#!/usr/bin/env bash
# The shards of an archive by GNU parallel, as docs/archive.md prints it.
#   parallel_test.sh SOURCE_FOLDER SIXPOINT_PROGRAM
set -euo pipefail
command -v parallel >/dev/null && parallel --version 2>/dev/null | grep -q GNU ||
  exec "$1/tests/skip.sh" "no GNU parallel; install parallel"
source "$1/tests/schedulers/archive.sh"
make_archive "$@"
run() {
  parallel --will-cite --halt never --joblog "$scratch/log" -j 3 \
    "$2" archive run "$data/plan" --shard '{}' -o "$data/out" ::: $(seq 0 5) >/dev/null 2>&1
}
run "$@" || { echo "FAILED: a shard failed"; cat "$scratch/log"; exit 1; }
run "$@" || { echo "FAILED: done shards run again"; exit 1; }
"$2" archive merge "$data/plan" >/dev/null 2>&1 || { echo "FAILED: the archive is not complete"; exit 1; }
compare_with_one_repair "$data/out"
echo "six shards by parallel: the same $repaired files as one repair"
