#!/bin/sh
# A Slurm of one node on this machine, as root, in a container or a virtual machine made for it:
# no accounting, no cgroups. `cluster.sh up`, `cluster.sh down`. Overwrites /etc/slurm/slurm.conf,
# as the job steps look for it there; refuses where one exists that it has not written.
set -eu

conf=/etc/slurm/slurm.conf
state=/var/tmp/imuarray-slurm
mark="# written by imuarray's tests/slurm/cluster.sh"

say() { echo "cluster: $*" >&2; }

up() {
    for program in munged slurmctld slurmd sinfo; do
        PATH=$PATH:/usr/sbin command -v "$program" >/dev/null || {
            say "expected $program, found none: apt-get install -y --no-install-recommends" \
                "slurmctld slurmd slurm-client munge slurm-wlm-basic-plugins"
            exit 2
        }
    done
    if [ -e "$conf" ] && ! grep -qF "$mark" "$conf"; then
        say "expected no $conf, or one of mine, found another: this machine has a Slurm of its own"
        exit 2
    fi
    [ "$(id -u)" = 0 ] || { say "expected root, found $(id -un)"; exit 2; }
    mkdir -p "$state/spool" "$state/ctld" /etc/slurm /run/munge
    host=$(hostname)
    memory=$(awk '/MemTotal/ {print int($2 / 1024 * 0.9)}' /proc/meminfo)
    cat >"$conf" <<EOF
$mark
ClusterName=imuarray
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
ReturnToService=2
MinJobAge=3600
StateSaveLocation=$state/ctld
SlurmdSpoolDir=$state/spool
SlurmctldPidFile=$state/slurmctld.pid
SlurmdPidFile=$state/slurmd.pid
SlurmctldLogFile=$state/slurmctld.log
SlurmdLogFile=$state/slurmd.log
NodeName=$host CPUs=$(getconf _NPROCESSORS_ONLN) RealMemory=$memory State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
EOF
    [ -e /etc/munge/munge.key ] || mungekey --create
    chown -R munge: /run/munge /etc/munge /var/log/munge /var/lib/munge 2>/dev/null || true
    pgrep -x munged >/dev/null || su -s /bin/sh munge -c munged || munged --force
    PATH=$PATH:/usr/sbin
    pgrep -x slurmctld >/dev/null || slurmctld
    pgrep -x slurmd >/dev/null || slurmd
    for _ in $(seq 60); do
        if [ "$(sinfo --noheader --format=%t 2>/dev/null)" = idle ]; then
            say "up: $(sinfo --noheader --format='%n, %c cores, %m MB')"
            return
        fi
        sleep 0.5
    done
    say "expected an idle node within 30 s, found $(sinfo --noheader --format=%t 2>&1); see $state"
    exit 1
}

down() {
    scancel --user=root 2>/dev/null || true
    pkill -x slurmd || true
    pkill -x slurmctld || true
    pkill -x munged || true
    while pgrep -x slurmctld >/dev/null || pgrep -x slurmd >/dev/null; do sleep 0.2; done
    if [ -e "$conf" ] && grep -qF "$mark" "$conf"; then rm -f "$conf"; fi
    rm -rf "$state"
}

case "${1:-}" in
    up) up ;;
    down) down ;;
    *) echo "usage: cluster.sh up | down" >&2; exit 2 ;;
esac
