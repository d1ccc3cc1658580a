#!/usr/bin/env python3
"""Puts the page, the program as WebAssembly and the licences of its parts into one HTML file.

    packaging/onefile.py PROGRAM.wasm OUT.html LARGEST

Refuses to write more than LARGEST bytes. Needs Python 3.11 or later and nothing else. Modules of the page are kept in the order in which they import each other; the names in
their imports become marks, which the file replaces by the places of the modules when it is opened.
"""

import base64
import gzip
import hashlib
import json
import pathlib
import re
import sys

import sbom

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGE = ROOT / "crates/moiregauge-serve/page"
WITHIN = ROOT / "crates/moiregauge-browser/page"
NEEDED = (
    "Needed: Chromium, Chrome or Edge 103, Firefox 113, Safari 16.4, or a later one; on a PC a processor with SSE 4.1; "
    "WebAssembly not switched off by a policy."
)
IMPORT = re.compile(r"""((?:^import\b[^"']*|^\} from |\bawait import\()\s*)["']\./([\w.]+)["']""", re.M)


def modules():
    """Names and texts, each after those that it imports."""
    texts = {path.name: path.read_text("utf-8") for folder in (PAGE, WITHIN) for path in folder.glob("*.js")}
    boot = texts.pop("boot.js")
    # Workers of pages that were opened from a disk cannot import: theirs is one script.
    worker = re.sub(r"^export ", "", texts.pop("wasi.js"), flags=re.M) + re.sub(r'^import .*$', "", texts.pop("worker.js"), flags=re.M)
    clash = {path.name for path in PAGE.glob("*.js")} & {path.name for path in WITHIN.glob("*.js")}
    if clash:
        sys.exit(f"two modules have one name: {clash}")
    done, order, above = set(), [], []

    def add(name):
        if name in done:
            return
        if name in above:
            sys.exit(f"modules import each other: {' '.join([*above, name])}")
        above.append(name)
        for _, other in IMPORT.findall(texts[name]):
            add(other)
        above.pop()
        done.add(name)
        order.append([name, IMPORT.sub(r'\1"moiregauge:\2"', texts[name])])

    for name in sorted(texts):
        add(name)
    left = [name for name, text in order if re.search(r"""from\s+["']\./""", text)]
    if left:
        sys.exit(f"imports that were not understood: {left}")
    return [*order, ["worker.js", worker]], boot


def licences():
    """Every part with its licence, and each text once."""
    data = sbom.metadata("wasm32-wasip1")
    packages = {package["id"]: package for package in data["packages"]}
    nodes = {node["id"]: node for node in data["resolve"]["nodes"]}
    root = next(p["id"] for p in data["packages"] if p["name"] == "moiregauge-browser")
    parts = sorted((packages[part] for part in sbom.linked(nodes, root)), key=lambda p: (p["name"], p["version"]))
    lines = [f"{p['name']} {p['version']}: {p['license'] or 'see its text'}" for p in parts]
    texts = {}
    for part in parts:
        folder = pathlib.Path(part["manifest_path"]).parent
        for path in sorted(p for p in folder.iterdir() if re.match(r"(?i)(licen[cs]e|copying|copyright|notice)", p.name) and p.is_file()):
            texts.setdefault(path.read_text("utf-8", "replace").strip(), []).append(part["name"])
    for path in (ROOT / "LICENSE-MIT", ROOT / "LICENSE-APACHE", *sorted((ROOT / "licenses").iterdir()), PAGE / "uPlot.LICENSE.txt"):
        texts.setdefault(path.read_text("utf-8").strip(), []).append(path.stem)
    return "\n\n".join(["moiregauge and its parts", "\n".join(lines), *(f"{', '.join(names)}\n\n{text}" for text, names in texts.items())])


SIGNS = bytes(sign for sign in range(32, 127) if sign != ord("<"))


def packed(name, data):
    """What is printed, but for what begins a tag, has 94 signs: eleven of them for nine bytes."""
    data = gzip.compress(data, 9, mtime=0)
    digits = bytearray()
    for at in range(0, len(data), 9):
        number = int.from_bytes(data[at : at + 9].ljust(9, b"\0"), "big")
        block = bytearray(11)
        for place in reversed(range(11)):
            number, block[place] = divmod(number, len(SIGNS))
        digits += block
    text = digits.translate(SIGNS.ljust(256, b"\0")).decode()
    return f'<script type="text/plain" id="{name}" data-bytes="{len(data)}">{text}</script>'


def main(program, out, largest):
    order, boot = modules()
    styles = "\n".join((PAGE / name).read_text("utf-8") for name in ("uPlot.min.css", "style.css", "views.css"))
    page = {"modules": order, "styles": styles, "licences": licences(), "icon": (PAGE / "icon.svg").read_text("utf-8")}
    index = (PAGE / "index.html").read_text("utf-8")
    body = re.search(r"<body>(.*)</body>", index, re.S).group(1)
    body = re.sub(r"\s*<noscript>.*?</noscript>", "\n  <noscript>This page needs JavaScript; it loads nothing.</noscript>", body, flags=re.S)
    hashed = base64.b64encode(hashlib.sha256(boot.encode()).digest()).decode()
    policy = (
        f"default-src 'none'; script-src 'sha256-{hashed}' blob: 'wasm-unsafe-eval'; worker-src blob:; style-src 'unsafe-inline'; "
        "img-src blob: data:; font-src data:; base-uri 'none'; form-action 'none'"
    )
    html = f"""<!doctype html>
<html lang="en">
<head>
  <meta charset="utf-8">
  <meta http-equiv="Content-Security-Policy" content="{policy}">
  <meta name="viewport" content="width=device-width, initial-scale=1">
  <meta name="referrer" content="no-referrer">
  <title>moiregauge</title>
</head>
<body><p id="opening">{NEEDED}</p>{body}  <details id="licences"><summary>Licences</summary><pre tabindex="0" aria-label="Licences"></pre></details>
{packed("page", json.dumps(page).encode())}
{packed("program", pathlib.Path(program).read_bytes())}
<script>{boot}</script>
</body>
</html>
"""
    if "http://" in html or "https://" in html:
        sys.exit("the file names an address")
    if len(html.encode()) > int(largest):
        sys.exit(f"the file has {len(html.encode())} bytes, more than {largest}")
    pathlib.Path(out).write_text(html, "utf-8")
    print(f"{out}: {len(html.encode())} bytes")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
