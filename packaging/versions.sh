#!/usr/bin/env bash
# Do the version of the sources, the changelog and the citation agree with VERSION?
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
version=${1:?usage: packaging/versions.sh VERSION}
grep -qx "version = \"$version\"" Cargo.toml || { echo "Cargo.toml has another version than $version" >&2; exit 1; }
grep -qx "version: $version" CITATION.cff || { echo "CITATION.cff has another version than $version" >&2; exit 1; }
grep -q "^## $version" CHANGELOG.md || { echo "CHANGELOG.md has no heading for $version" >&2; exit 1; }
