#!/usr/bin/env bash
# A Slurm cluster of this machine alone, from Debian's slurm-wlm and munge, to try --cluster slurm on:
#   one_node_slurm.sh up FOLDER     starts it, with all it writes in FOLDER; then
#                                   SLURM_CONF=FOLDER/slurm.conf ./reproduce.sh --cluster slurm
#   one_node_slurm.sh down FOLDER   ends its jobs and daemons
# It needs root, and does not touch a cluster that the machine may belong to: keys, sockets and ports are its own.
set -euo pipefail

usage() {
  printf 'one_node_slurm.sh: usage: one_node_slurm.sh up|down FOLDER\n' >&2
  exit 2
}

fail() {
  printf 'Error: %s\n' "$1" >&2
  exit 1
}

[[ $# -eq 2 && ($1 == up || $1 == down) ]] || usage
mkdir -p -- "$2"
folder=$(realpath -- "$2")
export SLURM_CONF=$folder/slurm.conf
PATH=$PATH:/usr/sbin

# No accounting, and no control groups: a container may have none.
write_config() {
  local node memory
  node=$(hostname -s)
  memory=$(awk '/^MemTotal/ { print int($2 / 1024) - 200 }' /proc/meminfo)
  cat >"$SLURM_CONF" <<END
ClusterName=one
SlurmctldHost=$node
SlurmUser=root
SlurmctldPort=17817
SlurmdPort=17818
AuthInfo=socket=$folder/munge.socket
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
MailProg=/bin/true
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerParameters=batch_sched_delay=0,sched_min_interval=0
ReturnToService=2
NodeName=$node NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$memory
PartitionName=all Nodes=$node Default=YES MaxTime=INFINITE State=UP
END
}

start_munge() {
  (umask 077 && head -c 1024 /dev/urandom >"$folder/munge.key")
  munged --force --key-file="$folder/munge.key" --socket="$folder/munge.socket" \
    --pid-file="$folder/munged.pid" --log-file="$folder/munged.log" --seed-file="$folder/munged.seed"
}

# The node takes jobs a moment after its daemon has started.
wait_for_node() {
  local second
  for ((second = 0; second < 60; second++)); do
    [[ $(sinfo --noheader --format=%t 2>/dev/null) != idle ]] || return 0
    sleep 1
  done
  tail -n 20 "$folder"/*.log >&2
  fail "the node takes no jobs; logs: $folder"
}

up() {
  [[ $(id -u) -eq 0 ]] || fail "starting Slurm needs root"
  command -v munged slurmctld slurmd >/dev/null || fail "install slurm-wlm and munge"
  mkdir -p "$folder/state" "$folder/spool"
  write_config
  start_munge
  slurmctld
  slurmd
  wait_for_node
}

# Ends the daemon with this name, by the number it wrote itself, and waits for it.
stop() {
  local pid
  pid=$(cat "$folder/$1.pid" 2>/dev/null) || return 0
  kill "$pid" 2>/dev/null || return 0
  while kill -0 "$pid" 2>/dev/null; do sleep 0.1; done
}

down() {
  scancel --me 2>/dev/null || true
  stop slurmd
  stop slurmctld
  stop munged
}

"$1"
