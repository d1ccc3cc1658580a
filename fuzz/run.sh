#!/bin/sh
# Fuzzes every reader for some seconds each, one after the other, and prints how many executions
# each had. Needs a nightly toolchain and cargo-fuzz.
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
mkdir -p corpus/real
for file in "$real"/*/*; do
    case $file in
        *.json | *'*') ;;
        *) head -c 16384 "$file" >"corpus/real/$(basename "$file")" ;;
    esac
done

failed=0
for reader in "$@"; do
    mkdir -p "corpus/$reader"
    log=$(mktemp)
    if cargo +nightly fuzz run "$reader" "corpus/$reader" corpus/real -- \
        -max_total_time="$seconds" -max_len=16384 -timeout=10 -rss_limit_mb=2048 \
        -malloc_limit_mb=512 -print_final_stats=1 >"$log" 2>&1; then
        result=clean
    else
        result="FINDING (see artifacts/$reader)"
        failed=1
    fi
    count=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
    echo "$reader: ${count:-0} executions, $result"
    rm -f "$log"
done
exit $failed
