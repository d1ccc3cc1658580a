"""Pages of reference that the program and its schemas make.

    python3 docs/generate.py PROGRAM ROOT [DOCS]

writes reference/commands/*.md, results.md, map.md, settings.md, materials.md and samples.md into DOCS (the folder of the
sources where it is left out, which is how the pages that are kept are renewed), and caveats.md.
"""

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

MADE = "<!-- Made by docs/generate.py from the program. -->\n\n"
# Letters that Markdown would take for markup.
MARKUP = re.compile(r"([\\*_\[\]<>|#])")


class Program:
    """The program under its usual name, so that it says this name in its help."""

    def __init__(self, path):
        self.folder = tempfile.TemporaryDirectory()
        self.path = Path(self.folder.name) / "moiregauge"
        self.path.symlink_to(Path(path).resolve())

    def says(self, *words):
        done = subprocess.run([self.path, *words], capture_output=True, text=True, check=True)
        return done.stdout


def plain(text):
    """Text as Markdown that looks like it: code in backticks stays code."""
    parts = text.split("`")
    for i in range(0, len(parts), 2):
        parts[i] = MARKUP.sub(r"\\\1", parts[i])
    return "`".join(parts)


def commands_of(program):
    """Headings, each with names and one-line descriptions, in the order of the help."""
    listed = program.says("help").split("\nOptions:")[0]
    groups = []
    for line in listed.splitlines():
        name = re.match(r"  (\S+)\s+(.*)", line)
        if name:
            groups[-1][1].append((name[1], name[2]))
        elif re.match(r"[A-Z].*:$", line):
            groups.append((line[:-1], []))
    return groups


def paragraphs(lines):
    """Lines of a paragraph on one line, blank lines between paragraphs."""
    return "\n\n".join(" ".join(p.split()) for p in "\n".join(lines).split("\n\n") if p.strip())


def described(lines):
    """The description of an option: text, and the list of possible values where there is one."""
    text, values = [], []
    for line in lines:
        inner = line.strip()
        if inner.startswith("Possible values:"):
            values = [""]
        elif values and inner.startswith("- "):
            values.append(inner[2:])
        elif values and inner and line.startswith(" " * 12):
            values[-1] += " " + inner
        elif values and inner:
            text += ["", inner]
        else:
            text.append(inner)
    out = [plain(p) for p in paragraphs(text).split("\n\n") if p]
    for value in values[1:]:
        name, _, meaning = value.partition(":")
        out.append(f"- `{name}`: {plain(' '.join(meaning.split()))}" if meaning else f"- `{name}`")
    return out or [""]


def entries(lines):
    """Options or arguments of a section as a definition list."""
    out, term, about = [], None, []

    def close():
        if term is not None:
            first, *more = described(about)
            out.append(f"`{term}`\n: {first}\n" + "".join(f"\n  {m}\n" for m in more))

    for line in lines:
        head = re.match(r" {2,6}([-\[<]\S.*)$", line)
        if head:
            close()
            term, about = head[1], []
        else:
            about.append(line)
    close()
    return "\n".join(out)


def sections(text):
    """Head and sections of a help text: [(heading, lines)]."""
    found = [("", [])]
    for line in text.splitlines():
        if re.match(r"[A-Z].*:$", line) or line.startswith("Usage:"):
            found.append((line, []))
        else:
            found[-1][1].append(line)
    return found


def command_page(program, name):
    """The page of one command."""
    out = [f"# `moiregauge {name}`\n"]
    for heading, lines in sections(program.says(name, "--help")):
        if heading.startswith("Usage:"):
            out.append(f"```text\n{heading[7:]}\n```\n")
            out.append(plain(paragraphs(lines)))
        elif re.match(r"(Examples?|Formats).*:$", heading):
            block, _, after = "\n".join(lines).partition("\n\n")
            out.append(f"## {plain(heading[:-1])}\n\n```text\n{block.rstrip()}\n```\n\n{plain(paragraphs([after]))}")
        elif not heading:
            out.append(plain(paragraphs(lines)))
        else:
            out.append(f"## {plain(heading[:-1])}\n\n{entries(lines)}")
    return MADE + "\n\n".join(part.strip() for part in out if part.strip()) + "\n"


def write_commands(program, folder):
    """One page for each command, and the list of them."""
    folder.mkdir(parents=True, exist_ok=True)
    groups = commands_of(program)
    listed = [pair for _, pairs in groups for pair in pairs]
    for name, _ in listed:
        (folder / f"{name}.md").write_text(command_page(program, name), encoding="utf-8")
    rows = "\n".join(
        f"## {title}\n\n| command | what it does |\n| --- | --- |\n"
        + "".join(f"| [`{name}`]({name}.md) | {plain(about)} |\n" for name, about in pairs)
        for title, pairs in groups
    )
    names = "\n".join(name for name, _ in listed)
    index = (
        "# Commands\n\nEvery command and every option, as the program itself describes them (`moiregauge help COMMAND`).\n\n"
        f"{rows}\n"
        f"`{'moiregauge --version'}` says which version it is.\n\n:::{{toctree}}\n:hidden:\n\n{names}\n:::\n"
    )
    (folder / "index.md").write_text(MADE + index, encoding="utf-8")


def kind(entry):
    """What a value is, with links to the tables of its parts."""
    if "$ref" in entry:
        name = entry["$ref"].split("/")[-1]
        return f"[{name}](#{name.lower()})"
    for key in ("anyOf", "oneOf"):
        if key in entry:
            return " or ".join(dict.fromkeys(kind(one) for one in entry[key]))
    if "const" in entry:
        return f"`{json.dumps(entry['const'])}`"
    if "enum" in entry:
        return " or ".join(f"`{json.dumps(one)}`" for one in entry["enum"])
    types = entry.get("type", "any")
    types = types if isinstance(types, list) else [types]
    if "array" in types:
        items = entry.get("items")
        inner = kind(items) if isinstance(items, dict) else "any"
        count = entry.get("minItems")
        fixed = f" ({count})" if count and count == entry.get("maxItems") else ""
        types = [f"list{fixed} of {inner}" if one == "array" else one for one in types]
    return " or ".join(types)


def about(entry):
    """A description on one line; a summary in one table cell."""
    return plain(" ".join(entry.get("description", "").split()))


def table_of(name, entry):
    """The keys of one object, or the values of one choice."""
    out = [f"### {name}\n", about(entry) + "\n"]
    if entry.get("properties"):
        needed = entry.get("required", [])
        out.append("| key | type | meaning |\n| --- | --- | --- |")
        for key, value in entry["properties"].items():
            optional = "" if key in needed else " (may be left out)"
            default = f" Default: `{json.dumps(value['default'], ensure_ascii=False)}`." if "default" in value else ""
            out.append(f"| `{key}` | {kind(value)} | {about(value)}{default}{optional} |")
    choices = [one for one in entry.get("oneOf", []) + entry.get("anyOf", [])]
    if choices:
        out.append("| value | meaning |\n| --- | --- |")
        for one in choices:
            out.append(f"| {choice(one)} | {about(one)} |")
    elif "enum" in entry:
        out.append("One of " + ", ".join(f"`{json.dumps(one)}`" for one in entry["enum"]) + ".")
    return "\n".join(out) + "\n"


def choice(entry):
    """One of several forms of a value."""
    if entry.get("properties"):
        return ", ".join(f"`{key}`: {kind(value)}" for key, value in entry["properties"].items())
    return kind(entry)


# What is looked for most often, and where it is.
OFTEN = """## Where to find the usual numbers

| what | where |
| --- | --- |
| twist of a set, with its uncertainties | `sets[0].mean.twist_deg` |
| heterostrain, and the 95 % interval | `sets[0].mean.heterostrain_percent`, `sets[0].mean.strain_interval_95_percent` |
| drift | `sets[0].drift.x_nm_per_min`, `sets[0].drift.y_nm_per_min` |
| moiré vectors, free of drift | `sets[0].mean.vectors` |
| all sets together | `combined.twist_deg` |
| where the uncertainty comes from | `sets[0].mean.budget` |
| every solution of the lattice | `sets[0].mean.readings.solutions` |
| single scans, before and after the drift is removed | `sets[0].scans[0].twist_strain.sensor`, `sets[0].scans[0].twist_strain.drift_corrected` |
| caveats | `caveats[0].code` |
| which files, which settings, which version | `provenance`, `settings` |
"""


def schema_page(root, name, document, words):
    """All keys of a document."""
    path = f"crates/moiregauge-report/schema/{name}-1.schema.json"
    schema = json.loads((root / path).read_text(encoding="utf-8"))
    out = [
        f"# Keys of `{document}`\n",
        words + "\n",
        f"The JSON Schema is [{name}-1.schema.json](../../{path}). Numbers that could not be determined are `null`.\n",
        *([OFTEN] if name == "results" else []),
        "## The document\n",
        table_of(schema["title"], schema),
        "## Its parts\n",
    ]
    for part, entry in schema["$defs"].items():
        out.append(table_of(part, entry))
    return MADE + "\n".join(out)


def text_page(title, words, language, text):
    """A page that shows what the program prints."""
    return f"{MADE}# {title}\n\n{words}\n\n```{language}\n{text.rstrip()}\n```\n"


def materials_page(program):
    """The layers known by name, with their sources."""
    rows = []
    for line in program.says("moire", "--list").splitlines():
        numbers, _, source = line.partition("; ")
        found = re.match(r"(.+?)\s+(a = .*)$", numbers)
        if found:
            rows.append(f"| {found[1]} | {plain(found[2])} | {plain(source)} |")
    return (
        f"{MADE}# Materials\n\nLattice constant a and Poisson ratio ν of the layers that have a name, with the uncertainty that the "
        "budget takes for them (`moiregauge moire --list`). Give your own with `--lattice-constant`, `--poisson-ratio` or a file for "
        "`--materials`. What was not seen in print says so.\n\n"
        "| layer | values | sources |\n| --- | --- | --- |\n" + "\n".join(rows) + "\n"
    )


def main(path, root, docs):
    """Writes all pages."""
    program = Program(path)
    reference = docs / "reference"
    write_commands(program, reference / "commands")
    pages = {
        "reference/results.md": schema_page(
            root, "results", "results.json", "`moiregauge analyze` writes this document; its version is in `schema`. Lengths are in nm, "
            "angles in degrees, strains in per cent, times in s, velocities in nm/min; the unit is part of a key.",
        ),
        "reference/map.md": schema_page(
            root, "map", "map.json", "`moiregauge map` writes this document beside the arrays of `map.zarr`; units as in `results.json`."
        ),
        "reference/watch.md": schema_page(
            root, "watch", "moiregauge watch --json", "`moiregauge watch --json` prints one such object as a line for each new result, "
            "and gives it to `--exec`; units as in `results.json`.",
        ),
        "reference/settings.md": text_page(
            "Settings", "Every setting with its default, as `moiregauge config` prints it. Save it, change what you need, and give it to "
            "`moiregauge analyze --config FILE`. Options on the command line come on top.", "toml", program.says("config"),
        ),
        "reference/classes.md": text_page(
            "Classes of samples", "What `moiregauge simulate --sample CLASS[:KEY=VALUE,…]` can add to a sample, as "
            "`moiregauge simulate --list-samples` lists it. What becomes of each is measured in [Real samples](../samples.md).",
            "text", program.says("simulate", "--list-samples"),
        ),
        "reference/materials.md": materials_page(program),
        "caveats.md": program.says("explain", "--markdown"),
    }
    for name, text in pages.items():
        (docs / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    ROOT = Path(sys.argv[2]).resolve()
    main(sys.argv[1], ROOT, Path(sys.argv[3]).resolve() if len(sys.argv) > 3 else ROOT / "docs")
