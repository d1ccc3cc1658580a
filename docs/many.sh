#!/usr/bin/env bash
# Time and memory of `moiregauge campaign` with many small sets, to see that time is linear in sets and memory constant.
#
#   docs/many.sh PROGRAM [SETS…]        (100 and 1000 sets; 10000 take ten times as long)
#
# One set of two small frames is simulated; every sample is a folder with links to them. The most memory that a run had
# is what the system says of it. Measured with a program compiled for debugging, on two processors: 100 sets take 8.6 s
# of CPU and 24 MB, 1000 sets 84.8 s and 24 MB.
set -euo pipefail
program=$(realpath "${1:?the program to run}")
shift
[ $# -gt 0 ] || set -- 100 1000
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

"$program" simulate --out sim --name set --scans 2 --pixels 64 --noise 0.3 --seed 1 >simulated.txt
echo "sets  seconds of CPU  milliseconds a set  most memory MB"
for sets in "$@"; do
  mkdir "many-$sets"
  for n in $(seq -w "$sets"); do
    mkdir "many-$sets/$n"
    ln "$work"/sim/set/scan.*.spm "many-$sets/$n/"
  done
  python3 - "$program" "$sets" <<'PYTHON'
import resource, subprocess, sys
program, sets = sys.argv[1], int(sys.argv[2])
draws = ["--drift-draws", "0", "--strain-draws", "0"]
run = [program, "campaign", f"many-{sets}", "--out", f"out-{sets}", "--quiet", *draws]
subprocess.run(run, check=False, stderr=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
cpu = used.ru_utime + used.ru_stime
print(f"{sets:5} {cpu:14.1f} {1e3 * cpu / sets:19.1f} {used.ru_maxrss / 1e3:15.0f}")
PYTHON
  wc -l "out-$sets/samples.csv" | sed 's/^/      lines of /'
done
