#!/bin/bash
# A Slurm job array on this machine, with a Slurm of its own, compared bit by bit with a single run.
#
#     benchmarks/farm/slurm.sh QUELL PATTERN FIRST LAST [FRAMES_A_TASK]
#     benchmarks/farm/slurm.sh target/release/quell '../shared/frames/hall/noisy/hall.####.exr' 1 12 5
#
# Needs Debian's slurm-wlm and munge (apt-get install slurm-wlm munge), and root, since slurmd does. Starts munged,
# slurmctld and slurmd in a temporary folder, and ends them by their process numbers; nothing of the machine's own is touched.
# Exit status 0: every frame of the array equals that of the single run.
set -euo pipefail
quell=$(readlink -f "$1") pattern=$(readlink -f "$(dirname "$2")")/$(basename "$2") first=$3 last=$4 size=${5:-4}

work=$(mktemp -d /tmp/quell-slurm.XXXXXX)
chmod 755 "$work"
cleanup() {
    for name in slurmd slurmctld munged; do
        [ -s "$work/$name.pid" ] && kill "$(cat "$work/$name.pid")" 2>/dev/null || true
    done
    sleep 1
    rm -rf "$work"
}
trap cleanup EXIT

user=$(id -un) host=$(hostname -s) cpus=$(nproc)
mkdir "$work/munge" "$work/state" "$work/spool" "$work/out"
head -c 1024 /dev/urandom > "$work/munge/key"
chmod 700 "$work/munge" && chmod 400 "$work/munge/key"
munged --force --socket="$work/munge.socket" --key-file="$work/munge/key" --pid-file="$work/munged.pid" \
    --log-file="$work/munge/log" --seed-file="$work/munge/seed" --num-threads=2
cat > "$work/slurm.conf" <<EOF
ClusterName=quell
SlurmctldHost=$host
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
AuthInfo=socket=$work/munge.socket
CredType=cred/munge
SlurmctldPort=36817
SlurmdPort=36818
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
NodeName=$host CPUs=$cpus State=UNKNOWN
PartitionName=farm Nodes=$host Default=YES MaxTime=60 State=UP
EOF
export SLURM_CONF="$work/slurm.conf"
slurmctld -f "$SLURM_CONF"
slurmd -f "$SLURM_CONF"
for _ in $(seq 30); do
    sinfo -h -o %T 2>/dev/null | grep -q idle && break
    sleep 1
done
sinfo

tasks=$(((last - first) / size))
cat > "$work/clean.sh" <<EOF
#!/bin/bash
#SBATCH --job-name=clean
#SBATCH --array=0-$tasks
#SBATCH --cpus-per-task=1
#SBATCH --output=$work/task-%a.log
first=\$(($first + SLURM_ARRAY_TASK_ID * $size))
last=\$((first + $size - 1 > $last ? $last : first + $size - 1))
exec "$quell" denoise "$pattern" -o "$work/out/farm" --frames \$first-\$last --shot $first-$last --resume \
    --threads "\$SLURM_CPUS_PER_TASK"
EOF
sbatch --wait "$work/clean.sh" || { cat "$work"/task-*.log; exit 1; }
tail -n 2 "$work"/task-*.log
"$quell" denoise "$pattern" -o "$work/out/whole" --frames "$first-$last" -q
diff -rq "$work/out/farm" "$work/out/whole"
echo "$(ls "$work/out/farm" | wc -l) frames of $((tasks + 1)) tasks equal those of a single run, bit by bit"
