#!/usr/bin/env bash
# Builds into OUT what can be built on Linux: the static program, the Windows program, the Python wheel, the one HTML file, the list of
# parts (SBOM); with checksums.
# Says at the end what could not be built, and why.
#
#   packaging/build.sh OUT
#
# Needs a Rust toolchain. The Windows program needs gcc-mingw-w64-x86-64, and the target x86_64-pc-windows-gnu or the sources of
# the standard library (the component rust-src, or Debian's rustc-web with rust-web-src; `-Z build-std`); it is started under
# wine64 where there is one. The wheel needs Python 3.11 or later; maturin is installed in an environment of its own.
# The HTML file needs a compiler for WebAssembly (packaging/html.sh).
# PARTS="linux windows wheel html sbom" says what is wanted; all is.
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
untried=()
missing() { failed+=("$*"); echo "NOT BUILT: $*" >&2; }
small_enough() {
  local bytes
  bytes=$(stat -c %s "$1")
  echo "$(basename "$1"): $bytes bytes"
  [ "$bytes" -lt "$largest" ]
}
# NAME PROGRAM: an archive with the program, the documentation, scans to try it on, and the licences.
archive() {
  local folder=$out/$1
  rm -rf "$folder"
  mkdir -p "$folder"
  cp "$2" README.md CHANGELOG.md CITATION.cff LICENSE-MIT LICENSE-APACHE "$folder/"
  cp -r licenses "$folder/"
  if [ -d "$scratch/docs" ]; then cp -r "$scratch/docs" "$folder/docs"; fi
  if [ -d "$scratch/scans" ]; then cp -r "$scratch/scans" "$folder/scans"; fi
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
  "$program" simulate --out "$scratch" --name scans --scans 4 --pixels 192 || return 1
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

# Whether the page of `moiregauge serve` answers on loopback under WINE.
serves() {
  local port server answered=1
  port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
  "$1" moiregauge.exe serve 'mit Übung\scans\' --no-browser --port "$port" > serve.txt 2>&1 &
  server=$!
  for _ in $(seq 60); do
    if python3 -c 'import sys, urllib.request as u
assert b"moiregauge" in u.urlopen("http://127.0.0.1:%s/" % sys.argv[1], timeout=5).read()' "$port" 2> /dev/null; then
      answered=0
      echo "serve answers on 127.0.0.1:$port"
      break
    fi
    sleep 1
  done
  kill "$server" 2> /dev/null || true
  wait "$server" 2> /dev/null || true
  [ "$answered" -eq 0 ] || { echo "serve did not answer:" >&2; cat serve.txt >&2; }
  return "$answered"
}

# Starts the Windows program under wine: version, demonstration, a folder with an umlaut and a trailing backslash, the page.
under_wine() {
  local wine folder=$scratch/wine-test
  for wine in "$(command -v wine64 || true)" /usr/lib/wine/wine64 ""; do if [ -x "$wine" ]; then break; fi; done
  [ -n "$wine" ] || { untried+=("the Windows program: there is no wine64"); return; }
  export WINEPREFIX=$scratch/wine WINEDEBUG=-all
  mkdir -p "$folder"
  cp "$1" "$folder/"
  # Wine 8 has no bcryptprimitives.dll, which Windows has: one for this test.
  printf '%s\n' '#include <windows.h>' 'BOOLEAN NTAPI SystemFunction036(PVOID, ULONG);' \
    '__declspec(dllexport) BOOL ProcessPrng(PBYTE to, SIZE_T n) { return SystemFunction036(to, (ULONG)n); }' > "$folder/prng.c"
  x86_64-w64-mingw32-gcc -shared -o "$folder/bcryptprimitives.dll" "$folder/prng.c" -ladvapi32 || return 1
  cd "$folder" || return 1
  "$wine" moiregauge.exe --version &&
    "$wine" moiregauge.exe demo --out demo &&
    test -s demo/results/report.html &&
    "$wine" moiregauge.exe simulate --out 'mit Übung' --name scans --scans 2 --pixels 128 &&
    "$wine" moiregauge.exe analyze 'mit Übung\scans\' --out 'mit Übung\out' --quiet --no-png &&
    test -s 'mit Übung/out/report.html' &&
    serves "$wine" && cd "$root"
}

windows_program() {
  local triple=x86_64-pc-windows-gnu std=() bootstrap=0 compiler program
  command -v x86_64-w64-mingw32-gcc > /dev/null || { echo "there is no x86_64-w64-mingw32-gcc" >&2; return 1; }
  compiler=$(windows_compiler "$triple") || return 1
  if [ ! -d "$("$compiler" --print sysroot)/lib/rustlib/$triple" ]; then
    std=(-Z build-std=std,panic_unwind)
    bootstrap=1
  fi
  RUSTC=$compiler RUSTC_BOOTSTRAP=$bootstrap RUSTFLAGS="-C target-feature=+crt-static $remap" \
    CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER=x86_64-w64-mingw32-gcc \
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
  (cd crates/moiregauge-python && "$python/bin/maturin" build --profile dist --locked --out "$out") || return 1
}

# What the program is made of, as CycloneDX.
sbom() { packaging/sbom.py x86_64-unknown-linux-gnu > "$out/moiregauge-sbom.json"; }

wanted() { case " ${PARTS:-linux windows wheel html sbom} " in *" $1 "*) ;; *) return 1 ;; esac; }
if wanted linux; then linux_program || missing "the static Linux program"; fi
if wanted windows; then windows_program || missing "the Windows program"; fi
if wanted wheel; then (wheel) || missing "the wheel"; fi
if wanted html; then packaging/html.sh "$out/moiregauge.html" || missing "the HTML file"; fi
if wanted sbom; then sbom || missing "the list of parts"; fi
cd "$root"

cd "$out"
find . -maxdepth 1 -type f ! -name SHA256SUMS -printf '%f\n' | sort | xargs -r sha256sum > SHA256SUMS
echo
echo "In $out:"
cat SHA256SUMS
for what in "${untried[@]}"; do echo "NOT TRIED: $what"; done
for what in "${failed[@]}"; do echo "NOT BUILT: $what"; done
[ ${#failed[@]} -eq 0 ] || exit 77
