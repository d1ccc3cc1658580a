#!/usr/bin/env bash
# Writes simulated scans in every format and has independent readers look at them: numpy, gwyfile,
# tifffile, xarray with zarr, pyarrow, jsonschema. Installs them in an environment of its own.
#
#   docs/check_exports.sh [PROGRAM]     PROGRAM is built if it is not given
#
# Ends with 77, having said so, where Python or the packages cannot be had.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

skip() { echo "SKIPPED: $*"; exit 77; }
command -v python3 > /dev/null || skip "there is no python3"
python3 -m venv "$scratch/python" 2> "$scratch/log" || skip "python3 has no venv"
python=$scratch/python/bin/python
"$python" -m pip install --quiet --disable-pip-version-check \
  numpy gwyfile jsonschema tifffile 'xarray>=2024.10' 'zarr>=3' pyarrow 2> "$scratch/log" ||
  skip "the packages cannot be installed: $(tail -n 1 "$scratch/log")"

program=${1:-}
if [ -z "$program" ]; then
  (cd "$here/.." && cargo build --release --locked --quiet)
  program=${CARGO_TARGET_DIR:-$here/../target}/release/moiregauge
fi

cd "$scratch"
"$program" simulate --out scans --pixels 128 --scans 4 > /dev/null
scans=$(find scans -name '*.spm' | sort)
first=$(head -n 1 <<< "$scans")
mkdir converted
for format in npz gwy tiff csv zarr gxyzf; do
  "$program" convert --quiet "$first" "converted/scan.$format"
done
"$program" analyze scans/simulated --out results --no-report --quiet --parquet \
  --export corrected.gwy,corrected.npz,corrected.zarr
"$program" map scans/simulated --out maps --no-report --quiet
"$python" "$here/check_exports.py" "$scratch"
