#!/bin/sh
# Fuzzes every reader for some seconds each, one after the other, and prints how many executions
# each had. Needs a C++ compiler for libFuzzer itself; any toolchain does, stable or nightly, and so
# does `cargo fuzz`, which does the same.
#
#   fuzz/run.sh [SECONDS [READER…]]
#
# The seeds are the files that the unit tests of spmfile read; the folder of the test data, where
# there is one, adds the beginnings of real files.
set -eu
cd "$(dirname "$0")"
seconds=${1:-60}
[ $# -gt 0 ] && shift
[ $# -gt 0 ] || set -- $(sed -n 's/^path = "fuzz_targets\/\(.*\)\.rs"$/\1/p' Cargo.toml)

SPMFILE_SEEDS="$PWD/corpus" cargo test --quiet --manifest-path ../Cargo.toml -p spmfile --lib >/dev/null
real=${MOIREGAUGE_TESTDATA:-../../shared/data}/real
mkdir -p corpus/real artifacts
for file in "$real"/*/*; do
    case $file in
        *.json | *'*') ;;
        *) head -c 16384 "$file" >"corpus/real/$(basename "$file")" ;;
    esac
done

# Coverage of edges and comparisons, checks of overflow and of memory: what `cargo fuzz` asks for.
# Sanitizers are not stable, so a stable compiler has to be told that it may.
coverage="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
-Cllvm-args=-sanitizer-coverage-trace-compares -Cllvm-args=-simplifycfg-branch-fold-threshold=0"
host=$(rustc -vV | sed -n 's/^host: //p')
# The programs of this run: a later build does not change them.
programs=$(mktemp -d)
trap 'rm -rf "$programs"' EXIT
RUSTC_BOOTSTRAP=1 RUSTFLAGS="$coverage -Zsanitizer=address -Cdebug-assertions --cfg fuzzing" \
    CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/target}" \
    cargo build --quiet --release --target "$host" --bins
for reader in "$@"; do
    cp "${CARGO_TARGET_DIR:-target}/$host/release/$reader" "$programs"
done

failed=0
for reader in "$@"; do
    mkdir -p "corpus/$reader" "artifacts/$reader"
    log=$(mktemp)
    if "$programs/$reader" "corpus/$reader" corpus/real -artifact_prefix="artifacts/$reader/" \
        -max_total_time="$seconds" -max_len=16384 -timeout=60 -rss_limit_mb=2048 \
        -malloc_limit_mb=512 -print_final_stats=1 >"$log" 2>&1; then
        result=clean
    else
        result="FINDING (see artifacts/$reader)"
        cp "$log" "artifacts/$reader/log.txt"
        failed=1
    fi
    count=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    covered=$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -n 1)
    echo "$reader: ${count:-0} executions, ${covered:-0} edges, $result"
    rm -f "$log"
done
exit $failed
