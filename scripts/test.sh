#!/usr/bin/env bash
# Builds and tests everything, as CI does; works from a fresh clone on a fresh Debian 12 as root.
#   scripts/test.sh               all: tests, the unit tests again under ASan and UBSan (built by
#                                 clang; NOT_SANITIZED in tests/ names those left out), a minute of fuzzing, format, clang-tidy
#   scripts/test.sh --label L     builds what the tests of label L need and runs those
set -euo pipefail
cd "$(dirname "$0")/.."
label=""
case "${1:-}" in
  "") ;;
  --label) label=${2:?"--label needs a name: unit, usb, system, docs, python, r"} ;;
  *) echo "usage: scripts/test.sh [--label L]" >&2; exit 64 ;;
esac
# Page, USB and scheduler tests wait for most of their time: more of them run at a time than there are cores.
jobs=$(($(nproc) + 2))

second_try=""
step() { printf '\n== %s\n' "$*"; }
# ctest's own lines; skips are listed with their reasons, because a skip is not a pass.
run_ctest() {
  local folder=$1 log
  shift
  log=$(mktemp)
  local status=0
  ctest --test-dir "$folder" --output-on-failure --no-tests=error -j "$jobs" "$@" 2>&1 |
    tee "$log" || status=$?
  if grep -q 'Skipped' "$log"; then
    echo "These tests were skipped, which is not a pass:"
    grep 'Skipped' "$log" || true
  fi
  rm -f "$log"
  [ "$status" -eq 0 ] || run_failed_alone "$folder" || return "$status"
}
# The tests that failed once more, one at a time, so that what they say is the last that is printed. Tests that drive a
# browser, a virtual machine or an installed package run in real time and can fail because others took the
# processor: those pass when they pass alone, and are named. What else fails stays a failure.
run_failed_alone() {
  local folder=$1 failed others
  names() { ctest --test-dir "$folder" -N "$@" | sed -n 's/^ *Test *#[0-9]*: //p'; }
  failed=$(names --rerun-failed)
  others=$(grep -vxFf <(names -L '^(page|system|program)$') <<<"$failed" || true)
  [ -n "$failed" ] && [ "$(wc -l <<<"$failed")" -le 10 ] || return 1
  step "What failed, alone: ${failed//$'\n'/ }"
  ctest --test-dir "$folder" --rerun-failed --output-on-failure -j 1 && [ -z "$others" ] || return 1
  second_try+=$failed$'\n'
}

scripts/install_packages.sh build test python r
# All packages are installed now: a server that is missing is a failure.
export SIXPOINT_MUST_NOT_SKIP=1
source scripts/build_environment.sh

if [ -z "$label" ]; then
  step "Format"
  scripts/check_format.sh
fi

step "Release build (g++)"
configure release -DSIXPOINT_TESTS=ON -DSIXPOINT_BENCH=ON
cmake --build build -- --quiet

if [ -n "$label" ]; then
  run_ctest build -L "^$label\$"
  exit
fi

step "Tests; beside them the sanitized build is begun"
# Many tests wait for most of their time. What they leave of the processors compiles ahead: idle tasks in a session of their
# own, which stand back behind everything. What fails there fails again in the build below, which says so.
configure sanitize
setsid bash -c 'echo 19 >/proc/self/autogroup; exec chrt --idle 0 cmake --build build/sanitize -j "$(nproc)"' &>/dev/null &
ahead=$!
end_ahead() {
  kill -- "-$ahead" 2>/dev/null || true
  wait "$ahead" || true
}
trap end_ahead EXIT
run_ctest build
trap - EXIT
end_ahead

step "Build with AddressSanitizer and UndefinedBehaviorSanitizer (clang++)"
cmake --build build/sanitize -- --quiet
step "Unit tests under the sanitizers"
run_ctest build/sanitize -L '^unit$'

step "Fuzz targets, a minute"
fuzz/run.sh --seconds 60

# All files take an hour and more on two cores: those that scripts/tidy.stamp names as clean are left out. What is left
# when the time is over fails.
step "clang-tidy"
scripts/tidy.sh --within 3000

step "Everything passed"
[ -z "$second_try" ] || printf 'These tests failed beside others and passed alone:\n%s' "$second_try"
