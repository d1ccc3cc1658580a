#!/usr/bin/env bash
# The tests of coverage of the core with hundreds of draws; `cargo test` takes ten of each.
#
#   docs/draws.sh [DRAWS]      (200: half an hour on two cores)
set -euo pipefail
cd "$(dirname "$0")/.."
MOIREGAUGE_DRAWS=${1:-200} cargo test --release -p moiregauge --test science -- --nocapture \
  errors_cover_the_truth errors_of_partly_covered_frames_cover
