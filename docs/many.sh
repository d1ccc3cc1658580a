#!/usr/bin/env bash
# Time and memory of `moiregauge campaign` with many small sets, to see that time is linear in sets and memory constant.
#
#   docs/many.sh PROGRAM [SETS…]        (100 and 1000 sets; 10000 take ten times as long)
#
# Twenty sets of two small frames are simulated; every sample is a folder with links to one of them. The most memory that a
# run had is what the system says of it. What a run has written is removed before the next one. Measured with a release program
# on two busy processors: 1000 sets take 38 s of CPU and 22 MB, 10000 sets 369 s and 42 MB: 2 kB a set, for its row of the tables
# and its entry on the page; each leaves 13 kB on the disk.
set -euo pipefail
program=$(realpath "${1:?the program to run}")
shift
[ $# -gt 0 ] || set -- 100 1000
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

different=20
for n in $(seq 0 $((different - 1))); do
  "$program" simulate --out "sim-$n" --name set --scans 2 --pixels 64 --noise 0.3 --seed "$n" >simulated.txt
done
echo "sets  seconds of CPU  milliseconds a set  most memory MB  seconds  kB a set on the disk"
for sets in "$@"; do
  mkdir "many-$sets"
  for n in $(seq -w "$sets"); do
    mkdir "many-$sets/$n"
    ln "$work/sim-$((10#$n % different))"/set/scan.*.spm "many-$sets/$n/"
  done
  python3 - "$program" "$sets" <<'PYTHON'
import resource, subprocess, sys, time
program, sets = sys.argv[1], int(sys.argv[2])
draws = ["--drift-draws", "0", "--strain-draws", "0"]
run = [program, "campaign", f"many-{sets}", "--out", f"out-{sets}", "--quiet", *draws]
begun = time.monotonic()
subprocess.run(run, check=False, stderr=subprocess.DEVNULL)
took = time.monotonic() - begun
used = resource.getrusage(resource.RUSAGE_CHILDREN)
cpu = used.ru_utime + used.ru_stime
du = subprocess.run(["du", "-sk", f"out-{sets}"], check=True, capture_output=True, text=True)
disk = int(du.stdout.split()[0]) / sets
print(f"{sets:5} {cpu:14.1f} {1e3 * cpu / sets:19.1f} {used.ru_maxrss / 1e3:15.0f} {took:8.0f} {disk:21.1f}")
PYTHON
  wc -l "out-$sets/samples.csv" | sed 's/^/      lines of /'
  rm -r "many-$sets" "out-$sets"
done
