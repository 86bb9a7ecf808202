#!/usr/bin/env bash
# An archive on a real Slurm of three nodes on this machine: a task out of memory, one task twice at
# once, a node killed in mid-run and its tasks requeued, the merge as a job behind the array.
#   slurm_test.sh SOURCE_FOLDER SIXPOINT_PROGRAM
set -euo pipefail
here=$1/tests/schedulers
skip() { exec "$1/tests/skip.sh" "$2"; }
for needed in slurmctld slurmd munged sbatch unzip python3; do
  command -v "$needed" >/dev/null ||
    skip "$1" "no $needed; install slurmctld slurmd slurm-client munge unzip"
done
[ "$(id -u)" -eq 0 ] || skip "$1" "Slurm's daemons need root here"
source "$here/slurm_cluster.sh"
source "$here/archive.sh"

make_archive "$@"
trap 'stop_cluster; rm -rf "$scratch"' EXIT
start_cluster "$scratch/cluster" || { stop_cluster; skip "$1" "Slurm does not start on this machine"; }

# The program as the tasks call it: on n1 it waits to be killed with the node; the first task of shard 3
# takes more memory than it asked for.
mkdir "$scratch/on_n1"
cat >"$scratch/slow" <<WRAPPER
#!/bin/bash
if [ "\${SLURMD_NODENAME:-}" = n1 ]; then
  touch "$scratch/on_n1/\$\$"
  exec sleep 300
fi
if [ "\${SLURM_ARRAY_TASK_ID:-}" = 3 ] && mkdir "$scratch/greedy" 2>/dev/null; then
  exec python3 -c 'import time; x = bytearray(1500 << 20); time.sleep(60)'
fi
exec "$2" "\$@"
WRAPPER
chmod +x "$scratch/slow"
export SIXPOINT=$scratch/slow
jobs=$("$2" archive submit "$data/plan" -o "$data/out")
array=$(sed -n 's/^array //p' <<<"$jobs")
merge=$(sed -n 's/^merge //p' <<<"$jobs")
# Shard 1 a second time, at once: the lock lets one of them work, and the other one says so.
twice=$(sbatch --parsable --array=1 --output="$scratch/twice.log" "$data/plan/run.sbatch" "$data/out")

two_on_n1() { [ "$(ls "$scratch/on_n1" | wc -l)" = 2 ]; }
wait_for 60 two_on_n1 || { echo "FAILED: no two tasks run on n1"; squeue; exit 1; }
# shellcheck disable=SC2046 # a word each
kill_node n1 $(ls "$scratch/on_n1")
echo "node n1 killed with two tasks"

merged() { [ -f "$data/plan/merge.json" ]; }
wait_for 150 merged || { echo "FAILED: the merge did not run"; squeue; tail "$scratch"/cluster/log/slurmctld; exit 1; }
scontrol show job "$merge" | grep -q "afterany:$array\|Dependency=(null)" ||
  { echo "FAILED: the merge did not wait for the array"; exit 1; }
requeued=$(scontrol show job "$array" | grep -c 'Restarts=[1-9]' || true)
[ "$requeued" -ge 1 ] || { echo "FAILED: no task was requeued"; scontrol show job "$array" | grep -E "JobState|Restarts|NodeList"; exit 1; }

# The shard that ran out of memory is named as missing, with the command that runs it again.
missing=$(python3 -c 'import json, sys
print(*[s["shard"] for s in json.load(open(sys.argv[1]))["shards"] if s["state"] != "done"])' "$data/plan/merge.json")
[ "$missing" = 3 ] || {
  echo "FAILED: the shards that are missing are: $missing"
  grep -E "JobId=|n1" "$scratch/cluster/log/slurmctld" | tail -n 60
  exit 1
}
gone() { [ -z "$(squeue -h -j "$1" -o %i 2>/dev/null)" ]; }
wait_for 60 gone "$twice" || { echo "FAILED: the second task of shard 1 did not end"; exit 1; }
again=$(sbatch --parsable --array=3 --output="$scratch/again.log" "$data/plan/run.sbatch" "$data/out")
wait_for 60 gone "$again" || { echo "FAILED: shard 3 did not end"; exit 1; }
"$2" archive merge "$data/plan" >/dev/null 2>&1 || { echo "FAILED: the archive is not complete"; exit 1; }
compare_with_one_repair "$data/out"
echo "six tasks on three nodes, $requeued requeued, one out of memory: the same $repaired files as one repair"
