#!/bin/sh
# How accurate maps are as the program makes them: images with a known local twist and strain are written as arrays,
# mapped by the program without any hint of their lattice, and compared with the truth. Takes some minutes.
# Usage: docs/maps_accuracy.sh [PROGRAM]
set -eu
cd "$(dirname "$0")/.."
program=${1:-target/release/moiregauge}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
accuracy() { cargo run --release --quiet -p moiregauge --example map_accuracy -- "$@"; }
accuracy images "$folder" > "$folder/list"
echo "| image | good nodes | θ rms, ° | \\|E\\| rms, % | σ of θ covers |"
echo "| --- | --- | --- | --- | --- |"
while read -r name side; do
    if "$program" map "$folder/$name.npy" --size "${side}nm×${side}nm" --out "$folder/$name" \
        --no-report --quiet > "$folder/said" 2>&1; then
        accuracy compare "$name" "$folder/$name/map.gwy"
    else
        echo "| $name | $(tail -n 1 "$folder/said") |"
    fi
done < "$folder/list"
