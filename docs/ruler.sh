#!/usr/bin/env bash
# Single frames that show a moiré and the atoms of a layer, by a generator of its own in NumPy (docs/ruler.py). One JSON line for each frame; then a table.
#
#   docs/ruler.sh PROGRAM FIRST LAST OUT.jsonl [KIND…] [--ruler=1|2|auto|off] [--twist-sense=positive]
#   docs/ruler.sh table OUT.jsonl…                          (a Markdown table)
#
# Kinds: tbg (atoms of the upper layer), tbg-1 (of the lower one), gbn, gbn-1 (graphene on hBN), tmd, tmd-1 (WSe₂ on WS₂), none (no atoms),
# harmonics, grid, root3, adsorbate (none, but what may be taken for them), from (none, but those of another frame: --ruler-from).
# Needs NumPy. PYTHON (python3) and JOBS (1) can be set; KEEP=FOLDER keeps images and results there.
set -euo pipefail
export OPENBLAS_NUM_THREADS="${OPENBLAS_NUM_THREADS:-1}"
exec "${PYTHON:-python3}" "$(dirname "${BASH_SOURCE[0]}")/ruler.py" "${@:?see the head of this file}"
