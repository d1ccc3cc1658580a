#!/usr/bin/env bash
# Builds into OUT what can be built on Linux: the static program, the Windows program, the Python wheel; with checksums.
# Says at the end what could not be built, and why.
#
#   packaging/build.sh OUT
#
# Needs a Rust toolchain. The Windows program needs gcc-mingw-w64-x86-64, and the target x86_64-pc-windows-gnu or the sources of
# the standard library (the component rust-src, or Debian's rustc-web with rust-web-src; `-Z build-std`); it is started under wine64 where there is one. The wheel
# needs Python 3.11 or later; maturin is installed in an environment of its own.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(dirname "$here")
[ $# -eq 1 ] || { echo "usage: packaging/build.sh OUT" >&2; exit 2; }
mkdir -p "$1"
out=$(cd "$1" && pwd)
cd "$root"
target=${CARGO_TARGET_DIR:-$root/target}
largest=$((20 * 1000 * 1000))
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# The same sources give the same bytes, wherever they lie.
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2> /dev/null || echo 0)}
remap="--remap-path-prefix=$root=. --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo"

failed=()
missing() { failed+=("$*"); echo "NOT BUILT: $*" >&2; }
small_enough() {
  local bytes
  bytes=$(stat -c %s "$1")
  echo "$(basename "$1"): $bytes bytes"
  [ "$bytes" -lt "$largest" ]
}
# NAME PROGRAM: an archive with the program, the documentation, the licences and the words about it.
archive() {
  local folder=$out/$1
  rm -rf "$folder"
  mkdir -p "$folder"
  cp "$2" README.md CHANGELOG.md CITATION.cff LICENSE-MIT LICENSE-APACHE "$folder/"
  cp -r licenses "$folder/"
  if [ -d "$scratch/docs" ]; then cp -r "$scratch/docs" "$folder/docs"; fi
  case $1 in
    *windows*) (cd "$out" && python3 -m zipfile -c "$1.zip" "$1") ;;
    *) tar -C "$out" --sort=name --owner=0 --group=0 --mtime="@$SOURCE_DATE_EPOCH" -czf "$out/$1.tar.gz" "$1" ;;
  esac
  rm -rf "$folder"
}

linux_program() {
  local triple=x86_64-unknown-linux-gnu program
  # At a fixed address: tables of what is to be moved would be a megabyte.
  RUSTFLAGS="-C target-feature=+crt-static -C relocation-model=static $remap" \
    cargo build --profile dist --locked --package moiregauge-cli --target "$triple" || return 1
  program=$target/$triple/dist/moiregauge
  small_enough "$program" || { echo "the program is too large" >&2; return 1; }
  # Static: no library of the system is asked for, so that it starts on old distributions.
  if readelf -d "$program" | grep -q NEEDED; then echo "the program asks for libraries" >&2; return 1; fi
  if readelf -V "$program" | grep -q GLIBC_; then echo "the program asks for a version of glibc" >&2; return 1; fi
  "$program" --version || return 1
  # The documentation goes along: it opens from the file system.
  MOIREGAUGE=$program docs/build.sh "$scratch/docs" || { rm -rf "$scratch/docs"; missing "the documentation in the archives"; }
  archive "moiregauge-$triple" "$program"
}

# A compiler that has the standard library for Windows, or its source to make it of.
windows_compiler() {
  local compiler library
  for compiler in rustc /usr/bin/rustc; do
    command -v "$compiler" > /dev/null || continue
    library=$("$compiler" --print sysroot)/lib/rustlib
    if [ -d "$library/$1" ] || [ -d "$library/src/rust/library" ]; then echo "$compiler"; return; fi
  done
  echo "there is neither the standard library for $1 nor its source (rust-src, or rust-web-src of Debian)" >&2
  return 1
}

# Starts the Windows program where there is a wine, and analyses a folder with an umlaut and a trailing backslash.
under_wine() {
  local wine folder=$scratch/wine-test
  for wine in "$(command -v wine64 || true)" /usr/lib/wine/wine64 ""; do if [ -x "$wine" ]; then break; fi; done
  [ -n "$wine" ] || { echo "there is no wine64: the Windows program was not started"; return; }
  export WINEPREFIX=$scratch/wine WINEDEBUG=-all
  mkdir -p "$folder"
  cp "$1" "$folder/"
  # Wine 8 has no bcryptprimitives.dll, which Windows has: one for this test.
  printf '%s\n' '#include <windows.h>' 'BOOLEAN NTAPI SystemFunction036(PVOID, ULONG);' \
    '__declspec(dllexport) BOOL ProcessPrng(PBYTE to, SIZE_T n) { return SystemFunction036(to, (ULONG)n); }' > "$folder/prng.c"
  x86_64-w64-mingw32-gcc -shared -o "$folder/bcryptprimitives.dll" "$folder/prng.c" -ladvapi32 || return 1
  cd "$folder" || return 1
  "$wine" moiregauge.exe --version &&
    "$wine" moiregauge.exe simulate --out 'mit Übung' --name scans --scans 2 --pixels 128 &&
    "$wine" moiregauge.exe analyze 'mit Übung\scans\' --out 'mit Übung\out' --quiet --no-png &&
    test -s 'mit Übung/out/report.html' && cd "$root"
}

windows_program() {
  local triple=x86_64-pc-windows-gnu std=() program
  command -v x86_64-w64-mingw32-gcc > /dev/null || { echo "there is no x86_64-w64-mingw32-gcc" >&2; return 1; }
  RUSTC=$(windows_compiler "$triple") || return 1
  export RUSTC
  if [ ! -d "$("$RUSTC" --print sysroot)/lib/rustlib/$triple" ]; then
    std=(-Z build-std=std,panic_unwind)
    export RUSTC_BOOTSTRAP=1
  fi
  RUSTFLAGS="-C target-feature=+crt-static $remap" CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER=x86_64-w64-mingw32-gcc \
    cargo build "${std[@]}" --profile dist --locked --package moiregauge-cli --target "$triple" || return 1
  program=$target/$triple/dist/moiregauge.exe
  small_enough "$program" || return 1
  under_wine "$program" || return 1
  archive "moiregauge-$triple" "$program"
}

wheel() {
  local python=$target/packaging-python
  [ -d crates/moiregauge-python ] || { echo "there is no crates/moiregauge-python" >&2; return 1; }
  python3 -m venv "$python" && "$python/bin/python" -m pip install --quiet --disable-pip-version-check 'maturin>=1.16,<2' || return 1
  (cd crates/moiregauge-python && "$python/bin/maturin" build --release --locked --out "$out") || return 1
}

linux_program || missing "the static Linux program"
(windows_program) || missing "the Windows program"
(wheel) || missing "the wheel"

cd "$out"
find . -maxdepth 1 -type f ! -name SHA256SUMS -printf '%f\n' | sort | xargs -r sha256sum > SHA256SUMS
echo
echo "In $out:"
cat SHA256SUMS
for what in "${failed[@]}"; do echo "NOT BUILT: $what"; done
[ ${#failed[@]} -eq 0 ] || exit 77
