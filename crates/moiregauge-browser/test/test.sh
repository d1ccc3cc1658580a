#!/bin/sh
# Tests of the one HTML file, opened from the disk in a real browser: test.sh FILE.html PROGRAM [FILTER]
#
# PROGRAM is moiregauge, whose numbers those of the file are compared with; SETS names folders of recorded scans, divided by ":".
# The rest is as in ../../moiregauge-serve/browser/test.sh. Where there is Debian's Firefox ($FIREFOX), the file is tried in it, too.
# Ends with 77 where something is missing that is no part of the project.
set -eu
[ $# -ge 2 ] || { echo "usage: test.sh FILE.html PROGRAM [FILTER]" >&2; exit 2; }
HTML=$(realpath "$1") PROGRAM=$(realpath "$2")
here=$(cd "$(dirname "$0")" && pwd)
page=$here/../../moiregauge-serve/browser
for tool in node npm python3; do
  command -v "$tool" >/dev/null || { echo "$tool is missing: the HTML file is not tested" >&2; exit 77; }
done
CHROMIUM=${CHROMIUM:-$(command -v chromium || command -v chromium-browser || true)}
[ -n "$CHROMIUM" ] || { echo "chromium is missing: the HTML file is not tested" >&2; exit 77; }

WORK=$(mktemp -d)
trap 'rm -rf "$WORK"' EXIT
modules=${BROWSER_MODULES:-$WORK/modules}
if [ ! -d "$modules/node_modules/playwright-core" ]; then
  mkdir -p "$modules"
  cp "$page/package.json" "$page/package-lock.json" "$modules/"
  (cd "$modules" && npm ci --no-audit --no-fund --silent 2>/dev/null) || { echo "npm cannot fetch playwright-core and axe-core: the HTML file is not tested" >&2; exit 77; }
fi

"$modules/node_modules/.bin/tsc" -p "$here/tsconfig.json"
mkdir -p "$WORK/tests"
cp "$here"/*.mjs "$page/harness.mjs" "$WORK/tests/"
ln -s "$modules/node_modules" "$WORK/tests/node_modules"
firefox=${FIREFOX:-$(command -v firefox-esr || true)}
unset FIREFOX
export HTML PROGRAM CHROMIUM WORK
if [ -z "$firefox" ]; then
  echo "# firefox-esr is missing: the HTML file is tried in Chromium only"
  rm "$WORK/tests/firefox.test.mjs"
fi
FIREFOX_ESR=$firefox node --test --test-concurrency=1 --test-timeout=400000 ${3:+--test-name-pattern="$3"} "$WORK"/tests/*.test.mjs
