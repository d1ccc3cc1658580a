#!/usr/bin/env bash
# Measures the table of docs/speed.md anew and puts it there.
#
#   docs/speed.sh [WORD]      (some minutes; the rows with the word: scans, image, map, set, adding, read, validate,
#                             huge: files of 1 GB, only when asked for)
#
# Nothing else should run on the machine: processor seconds of a busy one are a third too many, and two threads gain nothing.
set -euo pipefail
cd "$(dirname "$0")/.."

table=$(mktemp)
trap 'rm -f "$table"' EXIT
cargo bench --quiet --workspace --bench speed -- "$@" | grep '^|' >"$table"
if [ $# -gt 0 ]; then
  cat "$table"
  exit
fi
page=docs/speed.md
awk -v table="$table" '
  /^<!-- speed.sh: begin -->$/ { print; while ((getline line < table) > 0) print line; skipping = 1 }
  /^<!-- speed.sh: end -->$/ { skipping = 0 }
  !skipping { if ($0 != "<!-- speed.sh: begin -->") print }
' "$page" >"$page.new"
mv "$page.new" "$page"
