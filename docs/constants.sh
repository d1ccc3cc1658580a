#!/usr/bin/env bash
# What each constant that decides a result does when it is half and twice as large: the measurements of docs/constants.md.
#
#   docs/constants.sh [WORK]      some hours of a processor; a line a measurement; goes on where it stopped
#
# WORK is for one state of the sources: another one needs another folder.
#
# In a copy of the sources the listed constants are read from the environment, so that one build serves all of them. Each
# run of the example `constants` then changes one; its output is compared with that of the unchanged copy. The recorded
# frames are taken from MOIREGAUGE_TESTDATA or ../shared/data. With ONLY=WORD only lines with that word are measured.
set -euo pipefail
cd "$(dirname "$0")/.."

work=${1:-/tmp/moiregauge-constants}
data=$(realpath "${MOIREGAUGE_TESTDATA:-../shared/data}")
mkdir -p "$work"

# place, NAME, scenes (words of their names, with commas), what is done at half and at double; see docs/constants.py.
cat >"$work/list.txt" <<'LIST'
stripes/find AROUND stripes: half double
stripes/find OFF_SHARE stripes: half double
stripes/find APART stripes: half double
stripes/find SMALLEST stripes: half double
stripes/nodes CROSSING stripes: half double
stripes/pilot CARRIED stripes: half double
campaign/combine WORSE set: half double
campaign/atomic LARGEST_ERROR atoms half double
campaign/atomic LARGEST_DISTORTION atoms half double
set/headers CLEAN_CHI2 set: half double
set/headers SHARE set: half double
set/moire MOST_STRAIN set: half double
frame/lag NOTHING lag,glitches,few,speeding half double
frame/lag FIRST_ORDER_TO lag,glitches,few,speeding half double
frame/sensors UPRIGHT lag,glitches,few,speeding half double
window/leaks ROUNDS map half double
window/widths WIDEST map half double
window/lines KEPT map half double
window/lines LEAST map half double
domains/nodes APART domains half double
domains/nodes RADIUS domains half double
domains/patch SMOOTH domains half double
coverage/phases LEAST_FREEDOM edge,island,grains half double
coverage/phases ROUNDS edge,island,grains half double
lattice/start FEWEST_CELLS edge,island,grains,twist-wave half double
spectrum/select EXPLAINED set: half double
spectrum/select PEAKS set: half double
spectrum/select GENERATORS set: half double
spectrum/select ORDERS set: half double
spectrum/look SHORT_SIDE set: half double
high_orders LEFT set: half double
scan/fingerprint MISSING set: half double
meaning/strengths WHOLE set: half closer
several/together NEAR_HIDDEN moirés half double
fit/choose TOLD_APART few,noisy,contrast half double
fit/lines MOST_BAD few,noisy,contrast half double
fit/frame FEWEST few,noisy,contrast half double
fit/local LEVER few,noisy,contrast half double
lattice/autocorrelation PATCH set: half double
lattice/autocorrelation MOST_PEAKS set: half double
region/smoothing OVER map half double
numbers MOST_ROUNDS set: half double
chi2 SIGNIFICANT set: half double
chi2 RARE set: half double
select LOWEST_CYCLES set: half double
select HIGHEST_FREQUENCY set: half double
select TOLERANCE set: half double
select MOST_DISTORTION set: half double
spectrum/error SECOND set: half double
spectrum/error THIRD set: half double
high_orders STANDS_OUT set: half double
high_orders FEWEST set: half double
coverage/look QUIET edge,island,grains half double
coverage/look INSIDE edge,island,grains half closer
coverage/look TYPICAL edge,island,grains half closer
coverage/look PLAIN edge,island,grains half double
coverage/settle FEWEST_CELLS edge,island,grains half double
coverage/find SAME edge,island,grains half double
coverage/find WORTH edge,island,grains half double
coverage/choose BETTER edge,island,grains half double
coverage/bend WILD edge,island,grains half double
coverage/bend POOR edge,island,grains half double
coverage/bend FRAME_ENDS twist-wave half double
coverage/grains BETTER edge,island,grains half double
coverage/grains MISFIT edge,island,grains half double
coverage/grains NEITHER edge,island,grains half double
coverage/grains SEEDS edge,island,grains half double
coverage/grains NEAR edge,island,grains half double
scan/grains SAME grains half double
bend THRESHOLD few,moirés,gradient,grains half double
bend HARMLESS few,moirés,gradient,grains half double
fit/bend CUBIC few,moirés,gradient,grains half double
fit/bend BEYOND few,moirés,gradient,grains half double
fit/bend THIRD_ORDER few,moirés,gradient,grains half double
fit/straight STEPS few,moirés,gradient,grains half double
lattice/ground PERIODS step,bump half double
lattice/ground ROUNDS step,bump half double
lattice/ground SMALLEST step,bump half double
frame/median_ground BINS step,bump half double
set/drift OUTRUN_SIGMAS step half double
set/drift KNOWN_TO grains half double
campaign/grains CONTRADICTED grains half double
campaign/grains BETTER_KNOWN grains half double
fit/closure STRONG few,noisy,contrast half double
fit/closure NOISE_KNOWN_TO few,noisy,contrast root double
fit/leverage ACROSS few,noisy,contrast half double
fit/places CHANCE bump,few,noisy half double
fit/places NEAR bump,few,noisy half double
fit/model CLIP few,noisy,contrast half double
fit/lines BAD few,noisy,contrast half double
several/together WEAKEST moirés half double
several/together ON_TRIAL moirés half double
doubts FEW_PERIODS few,noisy,contrast half double
doubts ANOTHER_LATTICE few,noisy,contrast half double
doubts NO_CHANCE few,noisy,contrast half double
shared SIGNIFICANT few,noisy,contrast half double
shared CORRELATED few,noisy,contrast half double
shared SEARCHED terrain,contrast half double
drift/linear WORST_CONDITION set: half double
joint/link SHARE set: half double
joint/link ACCELERATION set: half double
joint/solve LINKED set: half double
joint/found LOOSE set: half double
samples APART set: half double
samples SIGMAS set: half double
samples DRIFT set: half double
campaign/combine SAME_LATTICE set: half double
campaign/combine NEARLY_SAME set: half double
campaign/combine NO_CHANCE set: half double
headers SCATTER set: half double
headers FAR_BETTER set: half double
headers CLEAN set: half double
set/joint OUTLYING set: half double
set/joint FEWEST set: half double
lag IMPROVEMENT lag,glitches,few,speeding half double
lag EXCESS lag,glitches,few,speeding half double
lag SHARE lag,glitches,few,speeding half closer
frame/fit_plane OUTLIER_SIGMAS lag,glitches,few,speeding half double
identity OF_NOISE set: half double
identity CERTAIN set: half double
meaning/naming PLAUSIBLE_STRAIN set: half double
meaning/naming WEAK set: half closer
meaning/naming EVEN set: half double
meaning/naming BLUR set: half double
strengths LEFT_OUT set: half double
meaning/about CONTRADICTION set: half double
names LARGEST_STRAIN set: half double
closed_form MIRRORED_FROM set: half double
vector SIGNIFICANT set: half double
moire LARGE_STRAIN set: half double
atomic AMBIGUOUS set: half double
atomic LARGEST_MISFIT set: half double
calibrate LARGEST_MISFIT set: half double
window/blur IMPROBABLE map half double
window/setting STRAIGHT map half double
window/setting NEAR map half double
window/setting BESIDE map half double
window/setting LOST map half double
window/blur BLURRED map half double
window/setting SHARE map half closer
map/defects CLEAR map half double
window/smooth FAINT map half double
window/smooth WEAKEST map half double
window/widths ALLOWED map half double
window/leaks UNSURE map half double
map/register COHERENT map half closer
window/types MARGIN map half double
window/mixed WORTH map half double
window/carrier STIFFNESS map half double
window/smooth LEAST_SHARE map half double
regime RELAXED domains,boundary half double
regime BLURRED domains,boundary half double
regime VARIED domains,boundary half double
regime NOISY domains,boundary half double
domains/mesh STRETCH domains root double
domains/mesh AREA domains root double
domains/nodes WEAK domains half double
domains/nodes CLEAR domains half double
domains/nodes SHARE domains half closer
domains/nodes TELLING domains half double
domains/nodes LINES domains half double
stripes/find MEMBER stripes: half double
stripes/find PATTERN stripes: half double
stripes/find FEWEST stripes: half double
stripes/find ALONG stripes: half double
stripes/find SAME stripes: half double
window/setting LOST stripes: half double
stripes/nodes CROSSED stripes: half closer
window/setting STRAIGHT stripes: half double
window/blur OF_TWO stripes: half double
window/smooth WEAKEST stripes: half double
stripes/wave ENDS stripes: half double
LIST

program=$work/target/release/examples/constants
if ! [ -x "$program" ]; then
  rm -rf "$work/copy"
  mkdir -p "$work/copy"
  cp -r crates Cargo.toml Cargo.lock README.md "$work/copy"
  python3 docs/constants.py prepare "$work/copy/crates" "$work/list.txt"
  (
    cd "$work/copy"
    export CARGO_TARGET_DIR=$work/target CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16
    nice cargo build --release -p moiregauge --example constants
  )
fi

# scenes WORDS OUTPUT: the example over the scenes with these words.
scenes() {
  local words
  IFS=, read -ra words <<<"$1"
  nice -n 19 "$program" "$data" "${words[@]}" >"$2" 2>"$work/said.txt"
}

mkdir -p "$work/outputs"
while read -r place name words half double; do
  base=$work/outputs/$words.txt
  for how in "$half" "$double"; do
    line="$place::$name $how"
    output=$work/outputs/${line//\//.}.txt
    [[ -z ${ONLY:-} || $line == *"$ONLY"* ]] || continue
    [ -s "$base" ] || scenes "$words" "$base"
    if ! [ -s "$output" ]; then
      MOIREGAUGE_VARIED="$line" scenes "$words" "$work/new.txt" || echo "$words | said | it stopped: $(tail -1 "$work/said.txt")" >>"$work/new.txt"
      grep -q reached "$work/said.txt" || echo "$words | said | no scene comes to it" >>"$work/new.txt"
      mv "$work/new.txt" "$output"
    fi
    echo "| $line | $(python3 docs/constants.py compare "$base" "$output") |"
  done
done <"$work/list.txt"
