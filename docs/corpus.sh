#!/usr/bin/env bash
# Makes everything that the program makes, from a corpus, and prints the hash of every file: to prove that a change of
# the code changes no result.
#
#   docs/corpus.sh OLD > old.txt;  docs/corpus.sh NEW > new.txt;  diff old.txt new.txt      (some minutes each)
#
# OLD and NEW are programs on one machine: transforms choose their code by processor. The recorded files are taken from
# MOIREGAUGE_TESTDATA or ../shared/data. With KEEP=DIR the files themselves stay there.
set -uo pipefail
cd "$(dirname "$0")/.."

program=$(realpath "${1:?the program to run}")
accuracy=$PWD/docs/accuracy.toml
data=$(realpath "${MOIREGAUGE_TESTDATA:-../shared/data}")
work=${KEEP:-$(mktemp -d)}
mkdir -p "$work"
[ -n "${KEEP:-}" ] || trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
ln -sfn "$data" data
mkdir -p said

# run NAME ARGUMENTS…: what it says and its exit code are results, too.
run() {
  local name=$1
  shift
  "$program" "$@" >"said/$name.out" 2>"said/$name.err"
  echo "$?" >"said/$name.code"
}

simulated() { run "simulate-$1" simulate --out sim --name "$@" --force; }

run demo demo
run config config
run print-config simulate --print-config

simulated plain --seed 3 --scans 6 --pixels 192 --noise 0.5
simulated wide --seed 4 --scans 4 --pixels 256x128 --slow x --noise 0.5 --line-noise 0.3
simulated hbn --seed 5 --scans 4 --pixels 192 --layers graphene/hBN --twist 0.8 --biaxial 0.1
simulated walls --seed 6 --scans 4 --pixels 192 --sharpness 0.7
simulated moving --seed 7 --scans 8 --pixels 192 --acceleration 0.05 -0.03 --flicker 0.3
simulated atoms --seed 8 --scans 4 --pixels 256 --atoms 1 --size 5 5
simulated bare --seed 9 --scans 4 --pixels 192 --no-sensors --no-retrace
simulated large --seed 11 --scans 1 --pixels 384 --size 250 250
simulated strained --seed 10 --scans 4 --pixels 192 --twist 0.5 --strain 0.55 --size 150 150
run simulate-accuracy simulate --out sim --config "$accuracy" --seed 1

for method in lattice autocorrelation fourier paper; do
  run "plain-$method" analyze sim/plain --out "out/plain-$method" --method "$method" --no-png
done
for set in wide hbn walls moving bare strained simulated; do
  run "analyze-$set" analyze "sim/$set" --out "out/$set" --no-png
done
run all analyze sim/plain sim/wide sim/moving --out out/all --export set.gwy --parquet --overlap --strain-draws 200 --no-png
run atomic analyze sim/plain --atomic sim/atoms/*.spm --out out/atomic --twist-sense positive --no-png
run given analyze sim/plain/*00.spm --drift 0.5 -0.15 --out out/given --rotate-to-lab --json --no-png
run angle analyze sim/hbn --lattice-angle 11.2±0.3 --layers graphene/hBN --out out/angle --no-png
run moires analyze sim/plain --moires 2 --out out/moires --no-png
run calibrate calibrate sim/atoms/*.spm --material graphene --out scanner.toml
run calibrated analyze sim/plain --calibration scanner.toml --isotropic-strain 0.1 --out out/calibrated --no-png
run replay analyze --replay out/all/results.json --out out/replay

run map-plain map sim/plain --out out/map-plain --device 40nm×20nm --wanted 1.05±0.05 \
  --region bar=10,20,40,50 --profile 'cut=0,0 60,50'
run map-tiles map sim/large --out out/map-tiles --map-method tiles --no-png
run map-bands map sim/large/*00.spm --out out/map-bands --in-bands --no-png
run map-hbn map sim/hbn --out out/map-hbn --layers graphene/hBN --domains on --no-png

for set in data/sets/*/ data/hard/*/; do
  set=${set%/}
  name=${set//\//-}
  run "analyze-$name" analyze "$set" --size 200nm×200nm --out "out/$name" --no-png
done
run analyze-sets analyze data/sets/slow_x data/sets/slow_y --out out/sets
run map-sets map data/sets/slow_y --out out/map-sets --no-png
run map-bent map data/hard/bent/bent.npy --size 200nm×200nm --out out/map-bent --no-png
run map-grains map data/hard/two_grains/two_grains.npy --size 200nm×200nm --out out/map-grains --no-png

find data/real -type f ! -name '*.json' ! -name '*.md' ! -name '*.txt' | sort | while read -r file; do
  name=$(tr '/ ' '__' <<<"$file")
  run "info-$name" info --json "$file"
  run "analyze-$name" analyze "$file" --out "out/$name" --no-png
  run "map-$name" map "$file" --out "out/map-$name" --no-png
done
run convert convert data/real/nanoscope/icon_v91_tapping_4ch.spm scan.gwy
run convert-npz convert sim/plain converted-npz --to npz --rotate-to-lab

run plan plan --twist-sigma 0.02
run plan-like plan --twist-sigma 0.001 --strain-sigma 0.005 --like sim/plain/*.spm --out plan.toml
run moire-list moire --list
run moire-twist moire --twist 1.1 --strain 0.3 --strain-axis 20 --figure cell.svg
run moire-hbn moire --layers graphene/hBN --twist 0 --json
run moire-lengths moire --wavelengths 13.72,12.7,10.18 --meaning real-space --sigma 0.05
run moire-vectors moire --vectors 12.9,0.4 6.1,11.5 --sigma 0.02 --lattice-angle 11.2±0.3 --json
run validate validate --sets 3 --pixels 128 --scans 4 --out out/validate
run validate-peaks validate --sets 3 --pixels 128 --scans 4 --method autocorrelation

# What a run takes is no result.
sed -i -E 's/\b[0-9]+(\.[0-9]+)? ?(s|min|ms)\b/TIME/g' said/*.out said/*.err
find . -type f ! -name '*.lock' -print0 | sort -z | xargs -0 sha256sum
