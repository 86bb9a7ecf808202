#!/usr/bin/env bash
# Runs one scenario of the page in Debian's Chromium without its window, which takes two thirds of the processor time,
# or a check of its bundle.
#   run.sh SCENARIO SIXPOINT_PROGRAM SCREENSHOTS [USB_STATION]    bundle: dist/ is what the sources build to
# Skipped (tests/skip.sh: in CI a failure) where there is no Node, npm or Chromium, or npm cannot fetch what the lock file
# names.
set -euo pipefail
scenario=$1 program=$2 shots=$3
source_folder=$(cd "$(dirname "$0")/../.." && pwd)
web=$source_folder/station/web
skip() { "$source_folder/tests/skip.sh" "$*"; exit $?; }
command -v node >/dev/null && command -v npm >/dev/null || skip "node and npm are not installed (scripts/install_packages.sh test)"
chromium=${CHROMIUM:-/usr/bin/chromium-headless-shell}
[ "$scenario" = bundle ] || [ -x "$chromium" ] || skip "there is no Chromium at $chromium (scripts/install_packages.sh test)"

# What the lock file names, once; tests that start together wait for the first.
exec 9>"$web/.install.lock"
flock 9
if [ ! -e "$web/node_modules/.complete" ] || [ "$web/package-lock.json" -nt "$web/node_modules/.complete" ]; then
  log=$(mktemp)
  if ! (cd "$web" && npm ci --no-audit --no-fund >"$log" 2>&1); then
    tail -n 5 "$log"
    skip "npm ci failed; is the npm registry reachable?"
  fi
  touch "$web/node_modules/.complete"
fi
flock -u 9

if [ "$scenario" = bundle ]; then
  made=$(mktemp -d)
  trap 'rm -rf "$made"' EXIT
  (cd "$web" && npx --no-install tsc --noEmit && node build.mjs "$made")
  if ! diff -r "$made" "$web/dist" >/dev/null; then
    echo "FAILED: station/web/dist is not what station/web/src builds to; run: cd station/web && npm run build"
    exit 1
  fi
  bytes=0
  for file in "$web"/dist/* "$web"/src/index.html "$web"/src/icon.svg; do bytes=$((bytes + $(gzip -9 -c "$file" | wc -c))); done
  echo "the page: $bytes bytes gzipped"
  [ "$bytes" -lt 60000 ] || { echo "FAILED: more than 60 kB"; exit 1; }
  exit 0
fi
exec env CHROMIUM="$chromium" timeout 560 node "$source_folder/tests/page/scenarios.mjs" "$scenario" "$program" "$shots" ${4:+"$4"}
