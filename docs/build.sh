#!/usr/bin/env bash
# Builds the documentation into OUT, and fails on warnings.
#
#   docs/build.sh OUT
#
# MOIREGAUGE names the program that pages of reference and the gallery are made with; without it a release build is made.
# A Python environment is made beside the compiled files (or in MOIREGAUGE_DOCS_PYTHON, a folder that may exist already).
# SPHINXOPTS=-Dplot_gallery=0 leaves out the pictures of the gallery, to look at text quickly. Ends with 77, having said so, where Python or the packages cannot be had.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(dirname "$here")
[ $# -eq 1 ] || { echo "usage: docs/build.sh OUT" >&2; exit 2; }
mkdir -p "$1"
out=$(cd "$1" && pwd)

target=${CARGO_TARGET_DIR:-$root/target}
mkdir -p "$target"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
skip() { echo "SKIPPED: $*"; exit 77; }

# Python, once for each list of packages.
wanted=$(sha256sum "$here/requirements.txt" | cut -c 1-16)
venv=${MOIREGAUGE_DOCS_PYTHON:-$target/docs-python}
if [ "$(cat "$venv/wanted" 2> /dev/null)" != "$wanted" ]; then
  command -v python3 > /dev/null || skip "there is no python3"
  python3 -m venv --clear "$venv" 2> "$scratch/log" || skip "python3 has no venv"
  "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r "$here/requirements.txt" \
    2> "$scratch/log" || skip "the packages cannot be installed: $(tail -n 1 "$scratch/log")"
  echo "$wanted" > "$venv/wanted"
fi

program=${MOIREGAUGE:-}
if [ -z "$program" ]; then
  (cd "$root" && cargo build --release --locked --quiet --workspace --bins)
  program=$target/release/moiregauge
fi
program=$(cd "$(dirname "$program")" && pwd)/$(basename "$program")

# The pages as they are kept, and those that the program and the schemas make.
mkdir "$scratch/site"
cp -r "$here" "$scratch/site/docs"
export PYTHONDONTWRITEBYTECODE=1
ln -s "$root/crates" "$scratch/site/crates"
for file in README.md DESIGN.md CONTRIBUTING.md CHANGELOG.md CITATION.cff LICENSE-MIT LICENSE-APACHE CODE_OF_CONDUCT.md deny.toml; do
  if [ -e "$root/$file" ]; then cp "$root/$file" "$scratch/site/"; fi
done
ln -s "$root/packaging" "$scratch/site/packaging"
"$venv/bin/python" "$here/generate.py" "$program" "$root" "$scratch/site/docs"

MOIREGAUGE_PROGRAM=$program MOIREGAUGE_VERSION=$("$program" --version | awk '{ print $2 }') \
  SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git -C "$root" log -1 --format=%ct 2> /dev/null || date +%s)} \
  "$venv/bin/python" -m sphinx -W --keep-going -n -q ${SPHINXOPTS:-} -b html -d "$scratch/doctrees" "$scratch/site/docs" "$scratch/html"
"$venv/bin/python" "$here/check_site.py" "$scratch/html" "$program" "$root"
rm -rf "${out:?}"/*
cp -r "$scratch/html/." "$out/"
echo "$out/index.html"
