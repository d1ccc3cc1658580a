#!/usr/bin/env bash
# Repeats the accuracy table of docs/accuracy.md: simulates ten-scan sets, analyses them and prints the
# root-mean-square error against the truth and, in brackets, the rms of error/σ (1 for honest σ).
#
#   docs/accuracy.sh [SEEDS] [METHOD…]      (10 seeds and all methods: a minute or two)
set -euo pipefail
cd "$(dirname "$0")/.."

seeds=${1:-10}
methods=("${@:2}")
[ ${#methods[@]} -gt 0 ] || methods=(autocorrelation fourier lattice paper)

cargo build --release --quiet
moiregauge=${CARGO_TARGET_DIR:-target}/release/moiregauge
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

printf '%-6s %-16s %17s %17s %17s %17s\n' noise method 'drift x nm/min' 'drift y nm/min' 'twist °' 'strain %'
for noise in 0.5 2.0; do
  for seed in $(seq "$seeds"); do
    scans=$work/scans/simulated
    "$moiregauge" simulate --out "$work/scans" --config docs/accuracy.toml \
      --noise "$noise" --seed "$seed" --force >/dev/null
    for method in "${methods[@]}"; do
      # Named by hand: the name of a set then holds no comma, and awk can read its table.
      "$moiregauge" analyze "$scans" --out "$work/out" --method "$method" --set "simulated=$scans" \
        --no-report --quiet --force
      cat "$work/out/sets.csv" >>"$work/$noise-$method.csv"
    done
  done
  for method in "${methods[@]}"; do
    awk -F, -v noise="$noise" -v method="$method" '
      $1 == "set" { for (i = 1; i <= NF; i++) column[$i] = i; next }
      function add(k, name, sigma, truth,   off) {
        off = $column[name] - truth
        squares[k] += off * off
        pulls[k] += (off / $column[sigma]) ^ 2
      }
      {
        n++
        add(1, "drift_x_nm_per_min", "drift_x_sigma_nm_per_min", 0.50)
        add(2, "drift_y_nm_per_min", "drift_y_sigma_nm_per_min", -0.15)
        add(3, "twist_deg", "twist_sigma_deg", 1.13)
        add(4, "heterostrain_percent", "heterostrain_sigma_percent", 0.12)
      }
      END {
        printf "%-6s %-16s", noise, method
        for (k = 1; k <= 4; k++)
          printf " %10.6f (%4.1f)", sqrt(squares[k] / n), sqrt(pulls[k] / n)
        print ""
      }' "$work/$noise-$method.csv"
  done
done
