#!/usr/bin/env bash
# Sourced: an archive of simulated files, what one repair makes of it, and the comparison.
#   make_archive SOURCE_FOLDER PROGRAM; compare_with_one_repair OUTDIR
# In the new folder $scratch, which the test's end removes: $data/archive has 12 files of one unit, not affected
# and not readable ones too; $data/store.db knows the unit; $data/plan is its plan of six shards.
make_archive() {
  scratch=$(mktemp -d)
  chmod 755 "$scratch"
  trap 'rm -rf "$scratch"' EXIT
  data=$scratch/data
  program=$2
  local scenario=$1/tests/docs/scenario.json i
  mkdir -p "$data/archive/sub"
  for i in 1 2 3 4; do
    sed "s/\"seed\": 1/\"seed\": $i/" "$scenario" >"$data/scenario.json"
    "$program" simulate --scenario "$data/scenario.json" -o "$data/archive/day$i.gt3x" >/dev/null
    cp "$data/archive/day$i.gt3x" "$data/archive/sub/copy$i.gt3x"
  done
  sed 's/"firmware": "1.5.0"/"firmware": "1.8.0"/' "$data/scenario.json" >"$data/sound.json"
  "$program" simulate --scenario "$data/sound.json" -o "$data/archive/sub/sound.gt3x" >/dev/null
  export HOME=$data/home
  mkdir -p "$HOME"
  "$program" solve "$data/archive/day1.gt3x" --save --store "$data/store.db" >/dev/null
  cp "$data/store.db" "$data/one.db"
  "$program" repair "$data/archive" -o "$data/one" --store "$data/one.db" >/dev/null 2>&1 || true
  repaired=$(find "$data/one" -name '*.gt3x' | wc -l)
  [ "$repaired" -ge 8 ] || { echo "FAILED: one repair wrote $repaired files"; exit 1; }
  "$program" archive plan "$data/archive" -o "$data/plan" --store "$data/store.db" --shards 6 >/dev/null 2>&1
}

logs_of() {
  (cd "$1" && find . -name '*.gt3x' | sort | while read -r name; do
    echo "$name $(unzip -p "$name" log.bin | sha256sum)"
  done)
}

# compare_with_one_repair OUTDIR: the same files with the same logs, and one row each in the store.
# (The mark holds the time of the repair, so whole files differ.)
compare_with_one_repair() {
  diff <(logs_of "$data/one") <(logs_of "$1") ||
    { echo "FAILED: not the same files as one repair"; exit 1; }
  local rows
  rows=$(python3 -c "import sqlite3, sys
print(sqlite3.connect(sys.argv[1]).execute('select count(*), count(distinct output_sha256) from repairs').fetchone())" \
    "$data/store.db")
  [ "$rows" = "($repaired, $repaired)" ] ||
    { echo "FAILED: the store has $rows rows and outputs, not $repaired"; exit 1; }
}
