#!/usr/bin/env python3
"""Writes the list of the parts of the program (SBOM) as CycloneDX 1.5 JSON, from `cargo metadata` and Cargo.lock.

    packaging/sbom.py TRIPLE > moiregauge-sbom.json

Lists what is linked into the program `moiregauge` for TRIPLE, with versions, licences, checksums and who needs whom; what only builds
or tests it is left out. Needs Python 3.11 or later and nothing else.
"""

import json
import os
import pathlib
import subprocess
import sys
import tomllib
from datetime import datetime, timezone

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = "moiregauge-cli"


def metadata(triple):
    command = ["cargo", "metadata", "--format-version=1", "--locked", f"--filter-platform={triple}"]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout)


def linked(nodes, root):
    """Packages that the root needs to run, each with those it needs itself."""
    found, waiting = {}, [root]
    while waiting:
        package = waiting.pop()
        if package in found:
            continue
        # `kind` is null for what is linked, "dev" for tests, "build" for build scripts.
        needs = [d["pkg"] for d in nodes[package]["deps"] if any(k["kind"] is None for k in d["dep_kinds"])]
        found[package] = sorted(needs)
        waiting += needs
    return found


def component(package, checksums):
    name, version = package["name"], package["version"]
    about = {
        "type": "application" if name == PROGRAM else "library",
        "bom-ref": package["id"],
        "name": name,
        "version": version,
        "purl": f"pkg:cargo/{name}@{version}",
    }
    if package["description"]:
        about["description"] = " ".join(package["description"].split())
    if package["license"]:
        # Older crates write "MIT/Apache-2.0", which is no SPDX expression.
        about["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
    if checksum := checksums.get((name, version)):
        about["hashes"] = [{"alg": "SHA-256", "content": checksum}]
    if package["repository"]:
        about["externalReferences"] = [{"type": "vcs", "url": package["repository"]}]
    return about


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: packaging/sbom.py TRIPLE")
    found = metadata(sys.argv[1])
    # The folder of the sources says nothing to a reader.
    folder = f"path+{ROOT.as_uri()}"
    text = json.dumps(found).replace(folder, "workspace:")
    found = json.loads(text)
    packages = {p["id"]: p for p in found["packages"]}
    nodes = {n["id"]: n for n in found["resolve"]["nodes"]}
    root = next(i for i, p in packages.items() if p["name"] == PROGRAM)
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text())
    checksums = {(p["name"], p["version"]): p.get("checksum") for p in lock["package"]}
    needs = linked(nodes, root)
    made = datetime.fromtimestamp(int(os.environ.get("SOURCE_DATE_EPOCH", "0")), timezone.utc)
    document = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "timestamp": made.strftime("%Y-%m-%dT%H:%M:%SZ"),
            "component": component(packages[root], checksums),
            "properties": [{"name": "target", "value": sys.argv[1]}],
        },
        "components": [component(packages[i], checksums) for i in sorted(needs) if i != root],
        "dependencies": [{"ref": i, "dependsOn": needs[i]} for i in sorted(needs)],
    }
    json.dump(document, sys.stdout, indent=1, ensure_ascii=False)
    print()


if __name__ == "__main__":
    main()
