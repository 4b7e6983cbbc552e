#!/bin/sh
# `make test-slurm`: the quick run through a Slurm of one node gives the results of a local one.
# `run.sh DIRECTORY`: where both run; about two minutes each.
set -eu

root=$(cd "$(dirname "$0")/../.." && pwd)
where=${1:?expected a directory to run in}
mkdir -p "$where/local" "$where/slurm"
"$root/tests/slurm/cluster.sh" up
trap '"$root/tests/slurm/cluster.sh" down' EXIT

for kind in local slurm; do
    cp "$root/config.yaml" "$where/$kind/config.yaml"
done
common="-s $root/Snakefile --configfile config.yaml --quiet rules"
# a directory that has been used before is gone on with
(cd "$where/local" && snakemake $common --workflow-profile none --cores 2 quick)
# without accounting squeue is what reports jobs; a node of our own needs no patience, and groups
# of no more jobs side by side than it has cores
(cd "$where/slurm" && snakemake $common --workflow-profile "$root/profiles/slurm" \
    --jobs 2 --slurm-no-account --slurm-status-command squeue \
    --slurm-init-seconds-before-status-checks 1 --seconds-between-status-checks 1 \
    --group-components tuning=1 claims=2 bound=2 drawing=2 --latency-wait 5 quick)
cd "$root" && python -m tests.trees "$where/local/results" "$where/slurm/results"
