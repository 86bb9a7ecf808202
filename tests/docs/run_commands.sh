#!/usr/bin/env bash
# Runs every command that a ```sh block of README.md, docs/*.md, docs/tutorials/*.md or docs/devices/*.md prints, in a
# scratch folder for each document that looks as the reader's would: build/sixpoint, and in build/demo what scripts/demo.sh
# leaves. README.md and the tutorials begin with that alone; behind README.md's "Try it", as readers of the other
# documents are, there is `archive`, too. A command ends with 0 unless the line says "# exits with N". Commands of scripts/
# have tests of their own (demo) or are what runs this (test).
#   run_commands.sh SOURCE_FOLDER SIXPOINT_PROGRAM
set -euo pipefail
source_folder=$1
program=$2
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export SIXPOINT_SHARED=${SIXPOINT_SHARED:-$source_folder/../shared}
failures=0
run=0
"$source_folder/scripts/demo.sh" --archive "$program" "$scratch/demo" >/dev/null 2>&1

for document in "$source_folder"/README.md "$source_folder"/docs/*.md "$source_folder"/docs/devices/*.md \
  "$source_folder"/docs/tutorials/*.md; do
  name=${document#"$source_folder"/}
  folder=$scratch/${name//\//_}
  mkdir -p "$folder/build" "$folder/home"
  export HOME=$folder/home  # a default store of its own
  ln -s "$program" "$folder/build/sixpoint"
  ln -s "$scratch/demo" "$folder/build/demo"
  case $name in
    README.md | docs/tutorial*) ;;
    *) cp -r "$scratch/demo/archive" "$folder" ;;
  esac
  # The lines of all sh blocks, continued lines joined.
  mapfile -t commands < <(awk '/^```sh$/ { inside = 1; next } /^```/ { inside = 0 } inside' "$document" |
    sed -e ':a' -e '/\\$/N; s/\\\n//; ta' | grep -vE '^ *(#|$)' || true)
  for command in "${commands[@]}"; do
    case $command in
      scripts/*) [ -x "$source_folder/${command%% *}" ] || { echo "FAILED: no $command"; failures=1; }
        continue ;;
    esac
    expected=$(sed -n 's/.*# exits with \([0-9]*\).*/\1/p' <<<"$command")
    status=0
    output=$(cd "$folder" && bash -c "$command" </dev/null 2>&1) || status=$?
    run=$((run + 1))
    if [ "$status" -ne "${expected:-0}" ]; then
      printf 'FAILED: %s: "%s" ended with %s, not with %s:\n%s\n' "$(basename "$document")" \
        "$command" "$status" "${expected:-0}" "$output"
      failures=1
    fi
  done
done
echo "$run commands of the documentation were run"
[ "$run" -gt 10 ] || { echo "FAILED: fewer commands than the documentation prints"; failures=1; }
exit "$failures"
