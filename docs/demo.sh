#!/bin/sh
# Makes docs/demo.png anew: the first scan of the demonstration, and twist and strain of its scans.
# Run from the root of the repository.
set -eu
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT
cargo run --release -- demo --out "$folder/demo"
figures="$folder/demo/results/figures"
cargo run --release -p moiregauge-report --example side_by_side -- docs/demo.png 620 \
    "$figures/set1-scan.svg" "$figures/set1-twist-strain.svg"
