#!/bin/sh
# Tests of the page in a real browser: test.sh PROGRAM [FILTER]
#
# PROGRAM is moiregauge. Libraries go into a temporary folder (kept in $BROWSER_MODULES if that is set), the browser
# is Debian's chromium ($CHROMIUM names another one). Where there is Debian's Firefox ($FIREFOX), the views are tried in it,
# too; what needs downloads or emulation is not, since these are not to be had of a Firefox as it is. Screenshots of all views go to $SCREENSHOTS if it is set.
# Ends with 77 where something is missing that is no part of the project.
set -eu
IN_FIREFOX='a scan is shown|scans are analysed|that is dragged|arrow keys|painted|a map is made'
[ $# -ge 1 ] || { echo "usage: test.sh PROGRAM [FILTER]" >&2; exit 2; }
program=$(realpath "$1")
here=$(cd "$(dirname "$0")" && pwd)
for tool in node npm; do
  command -v "$tool" >/dev/null || { echo "$tool is missing: the page is not tested" >&2; exit 77; }
done
chromium=${CHROMIUM:-$(command -v chromium || command -v chromium-browser || true)}
[ -n "$chromium" ] || { echo "chromium is missing: the page is not tested" >&2; exit 77; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
modules=${BROWSER_MODULES:-$work/modules}
if [ ! -d "$modules/node_modules/playwright-core" ]; then
  mkdir -p "$modules"
  cp "$here/package.json" "$here/package-lock.json" "$modules/"
  (cd "$modules" && npm ci --no-audit --no-fund --silent 2>/dev/null) || { echo "npm cannot fetch playwright-core and axe-core: the page is not tested" >&2; exit 77; }
fi

"$modules/node_modules/.bin/tsc" -p "$here/tsconfig.json"
# Modules are looked for beside the tests, so these run as a copy.
mkdir -p "$work/tests"
cp "$here"/*.mjs "$work/tests/"
ln -s "$modules/node_modules" "$work/tests/node_modules"
firefox=${FIREFOX:-$(command -v firefox-esr || true)}
PROGRAM=$program CHROMIUM=$chromium PAGE=$(cd "$here/../page" && pwd) WORK=$work
export PROGRAM CHROMIUM PAGE WORK
unset FIREFOX
run() {
  node --test --test-concurrency=1 --test-timeout=400000 ${1:+--test-name-pattern="$1"} "$work"/tests/*.test.mjs
}
run "${2:-}"
if [ -n "$firefox" ] && [ $# -eq 1 ]; then
  echo "# in Firefox"
  FIREFOX=$firefox WORK=$work/firefox
  export FIREFOX
  mkdir "$WORK"
  run "$IN_FIREFOX"
fi
