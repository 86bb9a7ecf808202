#!/usr/bin/env bash
# The shards of an archive by Snakemake, with examples/snakemake/Snakefile; a shard that fails once.
#   snakemake_test.sh SOURCE_FOLDER SIXPOINT_PROGRAM
set -euo pipefail
command -v snakemake >/dev/null || exec "$1/tests/skip.sh" "no Snakemake; install snakemake"
source "$1/tests/schedulers/archive.sh"
make_archive "$@"

# Shard 3 fails at its first attempt.
cat >"$scratch/once" <<WRAPPER
#!/bin/bash
case " \$* " in *" --shard 3 "*) if mkdir "$scratch/failed" 2>/dev/null; then exit 74; fi ;; esac
exec "$2" "\$@"
WRAPPER
chmod +x "$scratch/once"
run() {
  mkdir -p "$scratch/project"
  snakemake --snakefile "$1/examples/snakemake/Snakefile" --directory "$scratch/project" --cores 3 --keep-going \
    --config "plan=$data/plan" "output=$data/out" "sixpoint=$scratch/once" >"$scratch/log" 2>&1
}
if run "$@"; then
  echo "FAILED: a shard that fails went unseen"
  exit 1
fi
[ ! -f "$scratch/project/merge.json" ] || { echo "FAILED: merged without shard 3"; exit 1; }
run "$@" || { echo "FAILED: the second run"; cat "$scratch/log"; exit 1; }
python3 - "$scratch/project/merge.json" <<'PYTHON'
import json, sys
merged = json.load(open(sys.argv[1]))
assert merged["complete"], "FAILED: not complete"
PYTHON
compare_with_one_repair "$data/out"
echo "six shards by Snakemake, one of them twice: the same $repaired files as one repair"
