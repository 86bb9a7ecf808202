#!/usr/bin/env bash
# Sourced: an archive of simulated files, what one repair makes of it, and the comparison.
#   make_archive FOLDER SCENARIO PROGRAM; compare_with_one_repair
# FOLDER/archive has 12 files of one unit, not affected and not readable ones too; FOLDER/store.db knows the unit.
make_archive() {
  folder=$1
  local scenario=$2
  program=$3
  local i
  mkdir -p "$folder/archive/sub"
  for i in 1 2 3 4; do
    sed "s/\"seed\": 1/\"seed\": $i/" "$scenario" >"$folder/scenario.json"
    "$program" simulate --scenario "$folder/scenario.json" -o "$folder/archive/day$i.gt3x" >/dev/null
    cp "$folder/archive/day$i.gt3x" "$folder/archive/sub/copy$i.gt3x"
  done
  sed 's/"firmware": "1.5.0"/"firmware": "1.8.0"/' "$folder/scenario.json" >"$folder/sound.json"
  "$program" simulate --scenario "$folder/sound.json" -o "$folder/archive/sub/sound.gt3x" >/dev/null
  export HOME=$folder/home
  mkdir -p "$HOME"
  "$program" solve "$folder/archive/day1.gt3x" --save --store "$folder/store.db" >/dev/null
  cp "$folder/store.db" "$folder/one.db"
  "$program" repair "$folder/archive" -o "$folder/one" --store "$folder/one.db" >/dev/null 2>&1 || true
  repaired=$(find "$folder/one" -name '*.gt3x' | wc -l)
  [ "$repaired" -ge 8 ] || { echo "FAILED: one repair wrote $repaired files"; exit 1; }
}

logs_of() {
  (cd "$1" && find . -name '*.gt3x' | sort | while read -r name; do
    echo "$name $(unzip -p "$name" log.bin | sha256sum)"
  done)
}

# compare_with_one_repair OUTDIR: the same files with the same logs, and one row each in the store.
# (The mark holds the time of the repair, so whole files differ.)
compare_with_one_repair() {
  diff <(logs_of "$folder/one") <(logs_of "$1") ||
    { echo "FAILED: not the same files as one repair"; exit 1; }
  local rows
  rows=$(python3 -c "import sqlite3, sys
print(sqlite3.connect(sys.argv[1]).execute('select count(*), count(distinct output_sha256) from repairs').fetchone())" \
    "$folder/store.db")
  [ "$rows" = "($repaired, $repaired)" ] ||
    { echo "FAILED: the store has $rows rows and outputs, not $repaired"; exit 1; }
}
