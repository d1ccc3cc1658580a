#!/usr/bin/env bash
# The program against sets of a scanner that bends and whose sensors record it, beside the same sets of a straight scanner, by a generator of its
# own in NumPy (docs/bent.py): uniform lattices of 5 to 12 periods, hysteresis of 0.4 to 3 % of the frame, logarithmic creep of 0.2 to
# 1.5 % a decade, four frames with alternating slow direction, trace and retrace. One JSON line for each set; then a table.
#
#   docs/bent.sh PROGRAM FIRST LAST OUT.jsonl [straight] [bent] [straight-changing] [bent-changing] [bent-unrecorded] [hysteresis-unrecorded]      (seeds FIRST to LAST)
#   docs/bent.sh table OUT.jsonl…                                    (a Markdown table)
#
# Needs NumPy. PYTHON (python3) and JOBS (1) can be set; KEEP=FOLDER keeps files and results there, MAPS=1 maps the sets as well.
set -euo pipefail
export OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}"
exec "${PYTHON:-python3}" "$(dirname "${BASH_SOURCE[0]}")/bent.py" "${@:?see the head of this file}"
