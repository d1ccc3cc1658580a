#!/usr/bin/env bash
# The program against images that it did not make: a generator in NumPy with physics of its own (docs/independent.py) writes sets of
# arrays, the program analyses them as a new user would, and a table compares the answers with the truth.
#
#   docs/independent.sh PROGRAM [SETS] [CLASS…]      (20 sets of every class: some minutes on two cores)
#
# Needs NumPy. PYTHON (python3) and JOBS (processors) can be set; KEEP=FOLDER keeps images and results there.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
exec "${PYTHON:-python3}" docs/independent.py "${1:?the program to run}" "${@:2}"
