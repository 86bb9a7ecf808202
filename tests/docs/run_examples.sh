#!/usr/bin/env bash
# Runs the two examples that each command's --help shows (cli/program/examples.cpp), in the order of that list, in one
# scratch folder with a store of its own. A line ends with 0 unless it says "# exits with N"; programs that run
# until they are ended are ended after some seconds.
#   run_examples.sh SOURCE_FOLDER SIXPOINT_PROGRAM
set -euo pipefail
source_folder=$1 program=$2
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export HOME=$scratch/home PATH=$scratch/bin:$PATH
mkdir -p "$scratch/bin" "$scratch/folder/archive" "$HOME"
ln -s "$program" "$scratch/bin/sixpoint"
cd "$scratch/folder"
cp "$source_folder/tests/docs/scenario.json" scenario.json
echo '{"schema": "sixpoint/scenario/1", "seed": 3, "protocol": "production"}' >protocol.json
for day in 1 2; do
  sed "s/\"seed\": 1/\"seed\": $day/" scenario.json >"day$day.json"
  sixpoint simulate --scenario "day$day.json" -o "archive/day$day.gt3x" 2>/dev/null
done
head -c 100000 archive/day1.gt3x >damaged.gt3x
for name in broken broken-too; do  # recordings of a session that end without warning
  timeout -s KILL 4 sixpoint jig --device virtual:seed=7,jig=auto,pace=real --store none.db --record $name.zip \
    >/dev/null 2>&1 || true
done
python3 "$source_folder/tests/docs/make_inputs.py" readings.csv capture.pcap

mapfile -t examples < <(sed -n 's/^ *"\(sixpoint .*\)"\(,\|}},\)$/\1/p' "$source_folder/cli/program/examples.cpp" | sed 's/\\"/"/g')
serial='' run='' constants='' jig='' failures=0
for example in "${examples[@]}"; do
  if [ -z "$run" ] && [ -e session.zip ]; then
    serial=$(sixpoint units --json | python3 -c 'import json,sys; print(json.load(sys.stdin)["units"][-1]["serial"])')
    read -r run constants jig < <(sixpoint history "$serial" --json | python3 "$source_folder/tests/docs/identifiers.py")
  fi
  line=$example
  for word in SERIAL:$serial RUN:$run CONSTANTS:$constants JIG:$jig; do
    line=$(sed "s/\b${word%%:*}\b/${word#*:}/g" <<<"$line")
  done
  expected=$(sed -n 's/.*# exits with \([0-9]*\).*/\1/p' <<<"$line")
  case $line in  # each is refused where it is so already
    "sixpoint store withdraw"*) sixpoint store reinstate "$constants" --why "measured again" &>/dev/null || true ;;
    "sixpoint store reinstate"*) sixpoint store withdraw "$constants" --why "fell again" &>/dev/null || true ;;
  esac
  case $line in
    "sixpoint virtual"* | "sixpoint station "*) line="timeout --preserve-status 5 $line" ;;
  esac
  status=0
  output=$(bash -c "$line" <<<'4711' 2>&1) || status=$?
  if [ "$status" -ne "${expected:-0}" ]; then
    printf 'FAILED: "%s" ended with %s, not with %s:\n%s\n' "$line" "$status" "${expected:-0}" "$output"
    failures=1
  fi
done
echo "${#examples[@]} examples were run"
[ "${#examples[@]}" -gt 100 ] || { echo "FAILED: fewer examples than the commands have"; failures=1; }
exit "$failures"
