#!/usr/bin/env bash
# The tests of coverage of the core with hundreds of draws, and the readers with ten thousand damaged copies of each file;
# `cargo test` takes a few of each.
#
#   docs/draws.sh [DRAWS]      (200: half an hour on two cores)
set -euo pipefail
cd "$(dirname "$0")/.."
MOIREGAUGE_DRAWS=${1:-200} cargo test --release -p moiregauge --test science -- --nocapture \
  errors_cover_the_truth errors_of_partly_covered_frames_cover coloured_noise_is_told_from_the_image \
  phases_on_the_ridge_of_line_noise_are_as_uncertain_as_they_say a_pair_of_frames_tells_the_scanner \
  one_frame_does_not_tell_drift_from_gain atoms_that_drift_turn_by_what_they_say_or_are_refused \
  headers_that_contradict_the_images_are_named a_constant_lattice_is_left_alone
MOIREGAUGE_MUTATIONS=10000 cargo test --release -p spmfile --test all -- --nocapture no_reader_stumbles
