"""Looks through the built site: nothing is loaded from elsewhere, and every option, key and caveat of the program is there.

    python3 docs/check_site.py HTML PROGRAM ROOT
"""

import html
import json
import re
import subprocess
import sys
from pathlib import Path

# What a browser would load by itself. Links that a reader may click are none of it.
LOADED = re.compile(
    r"""<(?:script|img|iframe|source|video|audio|embed)[^>]*\bsrc=["'](?:https?:)?//|"""
    r"""<link(?![^>]*rel=["'](?:canonical|search|author|index|next|prev|license))[^>]*\bhref=["'](?:https?:)?//"""
)
LOADED_BY_STYLE = re.compile(r"""@import\s+["']?(?:https?:)?//|url\(\s*["']?(?:https?:)?//""")


def main(site, program, root):
    """Prints what is wrong, and ends with the number of such things."""
    wrong, text = [], []
    pages = sorted(site.rglob("*.html"))
    for page in pages:
        content = page.read_text(encoding="utf-8")
        wrong += [f"{page.relative_to(site)} loads {found}" for found in LOADED.findall(content)]
        text.append(html.unescape(re.sub(r"<[^>]+>", " ", content)))
    for style in site.rglob("*.css"):
        wrong += [f"{style.relative_to(site)} loads {found}" for found in LOADED_BY_STYLE.findall(style.read_text(encoding="utf-8"))]
    text = "\n".join(text)
    said = subprocess.run([program, "explain", "--json"], capture_output=True, text=True, check=True).stdout
    wanted = {entry["code"] for entry in json.loads(said)}
    listed = subprocess.run([program, "help"], capture_output=True, text=True, check=True).stdout
    for command in re.findall(r"^  ([a-z]+) ", listed.split("\nOptions:")[0], re.M):
        about = subprocess.run([program, command, "--help"], capture_output=True, text=True, check=True).stdout
        wanted |= set(re.findall(r"^ +(?:-\w, )?(--[a-z0-9-]+)", about, re.M))
    for schema in ("results", "map"):
        document = json.loads((root / f"crates/moiregauge-report/schema/{schema}-1.schema.json").read_text(encoding="utf-8"))
        for part in [document, *document["$defs"].values()]:
            wanted |= set(part.get("properties", {}))
    words = set(re.findall(r"[\w-]+", text))
    wrong += [f"{word} is nowhere in the site" for word in sorted(wanted) if word not in words]
    if not (site / "searchindex.js").exists():
        wrong.append("there is no index for the search")
    print(f"{len(pages)} pages; {len(wanted)} options, keys and caveats looked for")
    print("\n".join(wrong))
    return len(wrong)


if __name__ == "__main__":
    sys.exit(1 if main(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])) else 0)
