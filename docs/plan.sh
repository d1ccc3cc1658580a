#!/usr/bin/env bash
# Predictions of `moiregauge plan` against the scatter of simulated sets: makes docs/plan.md. Takes about ten minutes on
# two cores.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
sets=${1:-400}
cargo build --release --quiet -p moiregauge-cli
program=${CARGO_TARGET_DIR:-target}/release/moiregauge
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$program" simulate --print-config | sed 's/^pixels = .*/pixels = [128, 128]/' > "$work/base.toml"
{
  printf '# Plans compared with simulated sets\n\n'
  printf 'For each target: the recommended plan, and the root-mean-square error over %s simulated sets of such scans\n' "$sets"
  printf '(mean of x and y, and of both strain components). `docs/plan.sh` makes this page.\n\n'
  printf '| target, conditions | scans | Hz | size (nm) | minutes | quantity | predicted σ | rms error | ratio |\n'
  printf '| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n'
  while IFS='|' read -r name wishes change; do
    sed "$change" "$work/base.toml" > "$work/conditions.toml"
    # shellcheck disable=SC2086 # several words on purpose
    "$program" plan $wishes --config "$work/conditions.toml" --out "$work/plan.toml" --force > "$work/plan.txt"
    "$program" validate --quiet --sets "$sets" --config "$work/plan.toml" --out "$work/out" --force > "$work/validated.txt"
    awk -F'[ \t]+' -v name="$name" '
      FNR == NR && /^(→|✗)/ && !seen { scans = $2; hz = $3; size = $4 " × " $6; minutes = $7; drift = $8; twist = $9; strain = $11; seen = 1 }
      FNR != NR && FNR > 1 {
        split($0, v, ",")
        n++; d += (v[2]^2 + v[4]^2) / 2; t += v[6]^2; e += (v[8]^2 + v[10]^2) / 2
      }
      END {
        row("drift (nm/min)", drift, sqrt(d / n))
        row("twist (°)", twist, sqrt(t / n))
        row("strain (%)", strain, sqrt(e / n))
      }
      function row(what, foreseen, found) {
        printf "| %s | %s | %s | %s | %s | %s | %s | %.2g | %.2f |\n", name, scans, hz, size, minutes, what, foreseen, found, found / foreseen
        name = scans = hz = size = minutes = ""
      }' "$work/plan.txt" "$work/out/sets.csv"
  done << 'WISHES'
twist ± 0.02°|--twist-sigma 0.02|
drift ± 0.005 nm/min|--drift-sigma 0.005|
drift ± 0.001 nm/min, frames no larger than 60 nm, 8 Hz|--drift-sigma 0.001 --max-size 60 --max-rate 8|
strain ± 0.0095 %, noise twice the signal|--strain-sigma 0.0095 --max-size 60 --max-rate 8|s/^pixel_deg = .*/pixel_deg = 2.0/
drift ± 0.01 nm/min, no position sensors|--drift-sigma 0.01 --max-size 80 --max-rate 8|s/^sensors = .*/sensors = false/;s/^gain = .*/gain = [1.0, 1.0]/;s/^shear_mrad = .*/shear_mrad = 0.0/
WISHES
  printf '\nAn rms over %s sets has an uncertainty of about %.0f %%.\n' "$sets" "$(awk -v n="$sets" 'BEGIN { print 100 / sqrt(2 * n) }')"
} > docs/plan.md
cat docs/plan.md
