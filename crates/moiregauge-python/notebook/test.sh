#!/usr/bin/env bash
# Tries the package in JupyterLab, in a real browser: results, light and dark, progress, plots, and a cell that is interrupted.
#
#   notebook/test.sh WHEEL        or PYTHON=… (an environment with the package and jupyterlab) notebook/test.sh
#
# JupyterLab goes into a temporary environment, the browser is the one of the page of `moiregauge serve`. The screenshots are
# SCREENSHOTS/jupyterlab.png and jupyterlab-dark.png. Ends with 77 where something is missing that is no part of the project.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
page=$here/../../moiregauge-serve/browser
chromium=${CHROMIUM:-$(command -v chromium || true)}
for tool in node npm; do command -v "$tool" > /dev/null || { echo "$tool is missing" >&2; exit 77; }; done
[ -n "$chromium" ] || { echo "chromium is missing" >&2; exit 77; }
work=$(mktemp -d)
server=
trap 'if [ -n "$server" ]; then kill "$server" 2> /dev/null || true; fi; rm -rf "$work"' EXIT

python=${PYTHON:-}
if [ -z "$python" ]; then
  python3 -m venv "$work/venv" || exit 77
  python=$work/venv/bin/python
  "$python" -m pip install --quiet --disable-pip-version-check "$1[all]" jupyterlab || exit 77
fi
modules=${BROWSER_MODULES:-$work/modules}
if [ ! -d "$modules/node_modules/playwright-core" ]; then
  mkdir -p "$modules"
  cp "$page/package.json" "$page/package-lock.json" "$modules/"
  (cd "$modules" && npm ci --no-audit --no-fund --silent) || exit 77
fi

mkdir "$work/notes" "$work/test"
cp "$here/jupyterlab.mjs" "$work/test/"
ln -s "$modules/node_modules" "$work/test/node_modules"
"$python" "$here/notebook.py" > "$work/notes/first.ipynb"
port=$("$python" -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
JUPYTER_CONFIG_DIR=$work/config JUPYTER_DATA_DIR=$work/data JUPYTER_RUNTIME_DIR=$work/runtime HOME=$work \
  "$python" -m jupyterlab --no-browser --allow-root --ip=127.0.0.1 --port="$port" --ServerApp.port_retries=0 \
  --IdentityProvider.token=notebook --ServerApp.root_dir="$work/notes" --LabApp.news_url= > "$work/log" 2>&1 &
server=$!
CHROMIUM=$chromium ADDRESS="http://127.0.0.1:$port/lab/tree/first.ipynb?token=notebook" SHOTS="${SCREENSHOTS:-$work}" \
  timeout 300 node "$work/test/jupyterlab.mjs" || { tail -n 20 "$work/log"; exit 1; }
