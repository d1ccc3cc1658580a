#!/usr/bin/env bash
# What the program says of real samples: simulates sets of each class, analyses them as a new user would, compares with the
# truth and prints docs/samples.md.
#
#   docs/samples.sh PROGRAM [SETS] [CLASS…] > docs/samples.md      (20 sets of every class: some minutes on two cores)
#
# What is done is kept in WORK (a folder of the system's for temporary files unless it is set), by program, class and seed:
# a run that was stopped goes on, more sets or classes add to what there is. PIXELS (192), SCANS (4), JOBS (processors) and
# FIRST (seed of the first set, 1) can be set, too. KEEP=1 keeps frames and results of sets that are wrong.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec python3 docs/samples.py "${1:?the program to run}" "${@:2}"
