#!/usr/bin/env bash
# The program against images as ordinary microscopes give them, by a generator of its own in NumPy (docs/ordinary.py): few spots, gains of
# lines, bent scanners, bad tips, dirty samples, second lattices, and no lattice at all. One JSON line for each set; then a table.
#
#   docs/ordinary.sh PROGRAM FIRST LAST OUT.jsonl [KIND…]      (seeds FIRST to LAST of every kind)
#   docs/ordinary.sh table OUT.jsonl…                          (a Markdown table)
#
# Needs NumPy. PYTHON (python3) and JOBS (1) can be set; KEEP=FOLDER keeps images and results there.
set -euo pipefail
export OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}"
exec "${PYTHON:-python3}" "$(dirname "${BASH_SOURCE[0]}")/ordinary.py" "${@:?see the head of this file}"
