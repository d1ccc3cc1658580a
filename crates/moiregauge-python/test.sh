#!/usr/bin/env bash
# Builds the wheel, installs it into an empty environment and runs its tests there: with numpy alone, then with all extras.
# Leaves with 77 where there is no Python 3.11 or newer, or no package can be installed. Further arguments go to pytest.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
# That of the workspace: most of it is built there already.
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/../../target}"

python=${PYTHON:-python3}
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || exit 77
scratch=$(mktemp -d)
corpus=
trap '[ -z "$corpus" ] || kill "$corpus" 2> /dev/null || true; rm -rf "$scratch"' EXIT
"$python" -m venv "$scratch/venv" || exit 77
environment=$scratch/venv
pip() { "$environment/bin/python" -m pip --quiet --disable-pip-version-check "$@"; }
pip install "maturin>=1.16,<2" || exit 77

"$environment/bin/maturin" build --release --locked --out "$scratch/wheel"
pip uninstall --yes maturin
ls -l "$scratch"/wheel/*.whl

# What hangs fails.
tested() { timeout "$1" "$environment/bin/python" -m pytest -q -p no:cacheprovider "${@:2}"; }
run() { tested 1500 tests --ignore tests/test_corpus.py "$@"; }
pip install "$scratch"/wheel/*.whl pytest
# What passes with numpy alone is not run again beside the extras.
but_for=(--but-for "$scratch/passed")
# Nothing but numpy comes along.
test "$(pip list --format freeze | grep -civE '^(moiregauge|numpy|pip|setuptools|pytest|pluggy|iniconfig|packaging|pygments)=')" -eq 0
run "${but_for[@]}" "$@"
# The corpus, once, beside the tests of the extras, which have an environment of their own.
if [ "$#" -eq 0 ]; then
  tested 2400 tests/test_corpus.py > "$scratch/corpus.log" 2>&1 &
  corpus=$!
fi
environment=$scratch/extras
"$python" -m venv "$environment"
pip install "$(ls "$scratch"/wheel/*.whl)[all]" pytest mypy pyright npe2 ipykernel
# It fetches its own program when it runs for the first time.
if ! "$environment/bin/pyright" --version > /dev/null 2>&1; then
  echo "NOT CHECKED: types by pyright, which cannot be fetched"
  set -- "$@" --deselect tests/test_words.py::test_types_are_right_for_pyright
fi
run "${but_for[@]}" "$@"
if [ -n "$corpus" ]; then
  status=0
  wait "$corpus" || status=$?
  corpus=
  cat "$scratch/corpus.log"
  [ "$status" -eq 0 ] || { echo "package and program do not give the same numbers" >&2; exit 1; }
fi
[ "${MOIREGAUGE_CORPUS:-}" = all ] || echo "NOT CHECKED: that package and program give the same numbers for each of the recorded files, but for each fourth (MOIREGAUGE_CORPUS=all)"

# As a new user would: in a browser.
status=0
pip install jupyterlab || status=77
[ "$status" -eq 77 ] || PYTHON=$environment/bin/python notebook/test.sh || status=$?
case $status in
  0) ;;
  77) echo "NOT CHECKED: the package in JupyterLab: no node, npm or chromium, or no packages" ;;
  *) echo "in JupyterLab it does not do what it should" >&2; exit 1 ;;
esac
