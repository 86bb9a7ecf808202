#!/usr/bin/env bash
# Sourced: a Slurm of three nodes on this machine, on loopback, with keys and folders of its own.
#   start_cluster FOLDER; ...; stop_cluster
# Sets SLURM_CONF. Every process is known by its pid file or its environment; nothing else is touched.
start_cluster() {
  cluster=$1
  local host base n
  host=$(hostname)
  base=$((20000 + RANDOM % 20000))
  mkdir -p "$cluster"/{munge,state,log}
  chmod 755 "$cluster" "$cluster/munge"
  dd if=/dev/urandom of="$cluster/munge/key" bs=1024 count=1 status=none
  chmod 600 "$cluster/munge/key"
  munged --force --key-file="$cluster/munge/key" --socket="$cluster/munge/socket" \
    --pid-file="$cluster/munge/pid" --seed-file="$cluster/munge/seed" --log-file="$cluster/munge/log"
  cat >"$cluster/slurm.conf" <<CONF
ClusterName=sixpoint
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$base
AuthType=auth/munge
AuthInfo=socket=$cluster/munge/socket,cred_expire=5
CredType=cred/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation=$cluster/state
SlurmdSpoolDir=$cluster/spool.%n
SlurmctldPidFile=$cluster/slurmctld.pid
SlurmdPidFile=$cluster/slurmd.%n.pid
SlurmctldLogFile=$cluster/log/slurmctld
SlurmdLogFile=$cluster/log/slurmd.%n
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=1
JobAcctGatherParams=OverMemoryKill
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
SlurmdTimeout=8
KillWait=2
JobRequeue=1
NodeName=n[1-3] NodeHostname=$host NodeAddr=127.0.0.1 Port=[$((base + 1))-$((base + 3))] CPUs=2 RealMemory=4000
PartitionName=all Nodes=ALL Default=YES State=UP MaxTime=INFINITE
CONF
  echo "CgroupAutomount=no" >"$cluster/cgroup.conf"
  export SLURM_CONF=$cluster/slurm.conf
  slurmctld -f "$SLURM_CONF"
  for n in n1 n2 n3; do
    mkdir -p "$cluster/spool.$n"
    slurmd -N "$n" -f "$SLURM_CONF"
  done
  for _ in $(seq 120); do
    [ "$(sinfo -h -t idle -o %D 2>/dev/null)" = 3 ] && return 0
    sleep 0.5
  done
  echo "the cluster did not come up:" >&2
  tail -n 5 "$cluster"/log/* >&2
  return 1
}

# kill_node n1 PID...: its daemon, the named processes of its tasks and all above them up to the keeper of the task,
# at once, as by a power cut: keepers first, since one that sees its task die reports that.
kill_node() {
  local node=$1 task line=()
  shift
  for task in "$@"; do
    while [ "${task:-1}" != 1 ]; do
      line=("$task" "${line[@]}")
      grep -q '^slurmstepd' "/proc/$task/comm" && break
      task=$(ps -o ppid= -p "$task" | tr -d ' ')
    done
    [ "${task:-1}" != 1 ] || { echo "FAILED: a task of $node has no keeper"; return 1; }
  done
  kill -9 "$(cat "$cluster/slurmd.$node.pid")" "${line[@]}"
}

stop_cluster() {
  local file
  [ -n "${cluster:-}" ] || return 0
  scancel -u root >/dev/null 2>&1 || true
  sleep 1
  for file in "$cluster"/slurmd.n*.pid "$cluster/slurmctld.pid" "$cluster/munge/pid"; do
    if [ -f "$file" ]; then kill "$(cat "$file")" 2>/dev/null || true; fi
  done
  sleep 1
  return 0
}

# wait_for SECONDS COMMAND...: until the command succeeds.
wait_for() {
  local until=$(($(date +%s) + $1))
  shift
  until "$@"; do
    [ "$(date +%s)" -lt "$until" ] || return 1
    sleep 0.5
  done
}
