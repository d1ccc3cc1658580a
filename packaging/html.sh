#!/usr/bin/env bash
# Makes one HTML file that needs no installation: the page of `serve` with its program as WebAssembly inside.
#
#   packaging/html.sh OUT.html
#
# Needs Python 3.11 and a Rust compiler for wasm32-wasip1: that of rustup (`rustup target add wasm32-wasip1`), or Debian's packages
# rustc-web, rust-web-src, lld and wasi-libc, with which the standard library is made. Ends with 77 where there is none.
# PROFILE names another profile than `dist`.
set -euo pipefail
root=$(dirname "$(dirname "$(realpath "${BASH_SOURCE[0]}")")")
[ $# -eq 1 ] || { echo "usage: packaging/html.sh OUT.html" >&2; exit 2; }
out=$(realpath -m "$1")
mkdir -p "$(dirname "$out")"
cd "$root"
target=${CARGO_TARGET_DIR:-$root/target}
triple=wasm32-wasip1
profile=${PROFILE:-dist}
python3 -c 'import tomllib' 2> /dev/null || { echo "there is no Python 3.11: the HTML file is not made" >&2; exit 77; }

# The library of C and the object that a module begins with, of a compiler or of the system.
libc=
compiler=
std=()
for compiler in rustc /usr/bin/rustc; do
  command -v "$compiler" > /dev/null || continue
  library=$("$compiler" --print sysroot)/lib/rustlib
  if [ -d "$library/$triple" ]; then
    libc=$library/$triple/lib/self-contained
    break
  elif [ -d "$library/src/rust/library" ] && [ -e /usr/lib/wasm32-wasi/crt1-reactor.o ] && command -v wasm-ld > /dev/null; then
    libc=/usr/lib/wasm32-wasi
    std=(-Z build-std=std,panic_abort)
    break
  fi
done
[ -n "$libc" ] || { echo "there is no compiler for $triple: rustup target add $triple, or rustc-web, rust-web-src, lld and wasi-libc of Debian" >&2; exit 77; }

export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2> /dev/null || echo 0)}
flags="-C target-feature=+simd128"
flags+=" --remap-path-prefix=$root=. --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo"
if [ ${#std[@]} -gt 0 ]; then
  flags+=" -C link-self-contained=no -L native=$libc -C linker=wasm-ld"
  grep -q pthread_create "$libc/libc.a" || flags+=" --cfg no_threads_in_libc"
  # What this compiler knows, and counts as unfinished.
  std+=(--ignore-rust-version)
  export RUSTC_BOOTSTRAP=1 RUSTC_WRAPPER=$root/packaging/older.sh
fi
upper=$(tr 'a-z-' 'A-Z_' <<< "$profile")
export "CARGO_PROFILE_${upper}_PANIC=abort"
RUSTC=$compiler RUSTFLAGS=$flags \
  cargo rustc "${std[@]}" --profile "$profile" --locked --package moiregauge-browser --target "$triple" -- \
  -C link-arg="$libc/crt1-reactor.o" -C link-arg=-zstack-size=8388608
# Six megabytes go onto any stick and through any mail; other profiles are for tests.
largest=6000000
[ "$profile" = dist ] || largest=12000000
python3 packaging/onefile.py "$target/$triple/$profile/moiregauge_browser.wasm" "$out" "$largest"
