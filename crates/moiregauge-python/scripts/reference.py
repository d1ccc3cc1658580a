"""Writes the pages of reference of the package, `docs/python/*.md`, from its sources: `python scripts/reference.py`.

`--check` writes nothing and fails where a page is not current. Needs Python alone: nothing is imported.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
PACKAGE = HERE / "python" / "moiregauge"
PAGES = HERE.parent.parent / "docs" / "python"
MADE = "<!-- Made by crates/moiregauge-python/scripts/reference.py; not to be edited. -->\n\n"

# Name of a page, file, name in it. Classes have a section for each of their own methods.
ENTRIES = [
    *((name, "_analyze", name) for name in ("read", "analyze", "analyze_moires", "measure", "map", "Campaign")),
    *((name, "_asks", name) for name in ("inspect", "moire", "plan", "simulate", "validate", "calibrate", "convert")),
    ("campaign.run", "campaign", "run"),
    ("campaign.maps", "campaign", "maps"),
    *((f"plot.{name}", "plot", name) for name in ("scan", "wavelengths", "drift", "twist_strain", "budget", "map")),
    ("Results", "_base", "ResultsBase"),
    ("MapResults", "_base", "MapBase"),
    ("Scan", "_scan", "Scan"),
    ("Channel", "_scan", "Channel"),
]

# Where the formulas behind a function stand, with their sources.
FORMULAS = {
    "analyze": ["lattice", "drift", "strain", "uncertainty"],
    "analyze_moires": ["lattice", "drift", "strain", "uncertainty"],
    "measure": ["lattice", "geometry", "strain"],
    "map": ["maps", "domains", "stripes"],
    "Campaign": ["lattice", "drift", "strain", "uncertainty"],
    "moire": ["strain"],
    "plan": ["uncertainty"],
    "simulate": ["strain", "geometry"],
    "validate": ["uncertainty"],
    "calibrate": ["geometry"],
    "campaign.run": ["lattice", "drift", "strain", "uncertainty"],
    "campaign.maps": ["maps"],
}
# What every function that takes options may raise.
ERRORS = {
    "ReadError": "a file is missing, damaged or no scan",
    "MeasureError": "nothing shows a lattice that could be measured",
    "ValueError": "options or arrays that make no sense; what was expected and what was found",
    "KeyboardInterrupt": "Ctrl-C; what was measured is kept where there is something that keeps it",
}


def found(file: str, name: str) -> ast.FunctionDef | ast.ClassDef:
    """A function or class of a file, a function with the arguments that it takes from another one."""
    tree = ast.parse((PACKAGE / f"{file}.py").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and node.name == name:
            for other in node.decorator_list:
                if isinstance(node, ast.FunctionDef) and ast.unparse(other).startswith("takes_what("):
                    assert isinstance(other, ast.Call)
                    taken = found(file, ast.unparse(other.args[0]))
                    assert isinstance(taken, ast.FunctionDef)
                    node.args = taken.args
            return node
    raise SystemExit(f"{file}.py has no {name}")


def signature(name: str, node: ast.FunctionDef) -> str:
    """As it is called, an argument a line where there are many."""
    given = node.args
    everything = [*given.posonlyargs, *given.args]
    defaults = [None] * (len(everything) - len(given.defaults)) + list(given.defaults)
    parts = [argument(one, value) for one, value in zip(everything, defaults, strict=True) if one.arg not in ("self", "cls")]
    if given.kwonlyargs:
        parts.append("*")
        parts += [argument(one, value) for one, value in zip(given.kwonlyargs, given.kw_defaults, strict=True)]
    if given.kwarg:
        parts.append(f"**{given.kwarg.arg}")
    back = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    line = f"{name}({', '.join(parts)}){back}"
    return line if len(line) < 90 else f"{name}(\n    " + ",\n    ".join(parts) + f",\n){back}"


def argument(one: ast.arg, default: ast.expr | None) -> str:
    text = one.arg + (f": {ast.unparse(one.annotation)}" if one.annotation else "")
    return text + (f" = {ast.unparse(default)}" if default is not None else "")


def body(node: ast.AST) -> str:
    """The words on it; lists of arguments become lists."""
    assert isinstance(node, (ast.FunctionDef, ast.ClassDef))
    words = ast.get_docstring(node) or ""
    out, inside = [], False
    for paragraph in words.split("\n\n"):
        if re.match(r"^[a-z_]\w*(, [a-z_]\w*)*: ", paragraph):
            items = re.split(r"\n(?=\S)", paragraph)
            out.append("\n".join("- " + item_of(item) for item in items))
        elif paragraph.startswith("    "):
            out.append("```python\n" + "\n".join(line[4:] for line in paragraph.splitlines()) + "\n```")
        else:
            out.append(plain(" ".join(paragraph.split())))
        inside = True
    return "\n\n".join(out) if inside else ""


def item_of(item: str) -> str:
    names, _, words = item.partition(": ")
    coded = ", ".join(f"`{name.strip()}`" for name in names.split(","))
    return f"{coded}: {plain(' '.join(words.split()))}"


def plain(words: str) -> str:
    """Brackets and stars of code stay in code."""
    return words.replace("<", "&lt;")


def errors(node: ast.AST) -> str:
    """What may be raised, by the words on the function and by what it takes."""
    assert isinstance(node, (ast.FunctionDef, ast.ClassDef))
    words = ast.get_docstring(node) or ""
    takes = {one.arg for one in [*node.args.args, *node.args.kwonlyargs]} if isinstance(node, ast.FunctionDef) else set()
    kinds = [kind for kind in ERRORS if kind in words]
    if "progress" in takes or "threads" in takes:
        kinds += [kind for kind in ("ValueError", "KeyboardInterrupt") if kind not in kinds]
    if "Raises as `analyze`" in words:
        kinds = list(ERRORS)
    return "\n".join(f"- `{kind}`: {ERRORS[kind]}" for kind in ERRORS if kind in kinds)


def page(name: str, file: str, inside: str) -> str:
    node = found(file, inside)
    out = [f"# `{'plot.' if name.startswith('plot.') else 'moiregauge.'}{name.removeprefix('plot.')}`"]
    if isinstance(node, ast.FunctionDef):
        out += [f"```python\n{signature(name.split('.')[-1], node)}\n```", body(node)]
    else:
        out.append(body(node))
        out += fields(node)
        for method in node.body:
            if isinstance(method, ast.FunctionDef) and not method.name.startswith("_") and ast.get_docstring(method):
                decorated = any(isinstance(one, ast.Name) and one.id == "property" for one in method.decorator_list)
                title = f"## `.{method.name}`" if decorated else f"## `.{method.name}()`"
                out += [title, "" if decorated else f"```python\n{signature(method.name, method)}\n```", body(method)]
                if raised := errors(method):
                    out.append("Errors:\n\n" + raised)
    if raised := errors(node):
        out.append("## Errors\n\n" + raised)
    if name in FORMULAS:
        where = ", ".join(f"[{one}](../explanation/{one}.md)" for one in FORMULAS[name])
        out.append(f"## Formulas and their sources\n\n{where}; each names its papers, and the functions and tests of the code.")
    return MADE + "\n\n".join(part for part in out if part) + "\n"


def fields(node: ast.ClassDef) -> list[str]:
    """The table of the fields of a dataclass."""
    rows = []
    for field, after in zip(node.body, [*node.body[1:], None], strict=True):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and not field.target.id.startswith("_"):
            told = after.value.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else ""
            kind = ast.unparse(field.annotation).replace("|", "\\|")
            rows.append(f"| `{field.target.id}` | `{kind}` | {plain(' '.join(str(told).split()))} |")
    return ["| field | type | |\n| --- | --- | --- |\n" + "\n".join(rows)] if rows else []


INDEX = """# Python

What each function of the package takes, gives and raises. The [tutorial](../tutorials/python.md) shows them at work.
Keywords of `**options` are the [settings](../reference/settings.md) and what files do not tell, under the same names as in
the program.

Lengths are nm, angles degrees counter-clockwise in laboratory axes, strains per cent, drift nm/min, times s. Arrays are
rows × columns with row 0 at the **bottom** and column 0 at the left; NaN is a missing pixel. An estimate has `value`,
`sigma` (statistical) and, in means, `sigma_total`. Every function gives the interpreter free while it works, stops at
Ctrl-C and may be called from several threads.

```{toctree}
:maxdepth: 1

"""


def pages() -> dict[str, str]:
    made = {f"{name}.md": page(name, file, inside) for name, file, inside in ENTRIES}
    return {"index.md": MADE + INDEX + "\n".join(name for name, _, _ in ENTRIES) + "\n```\n", **made}


def main() -> None:
    wanted = pages()
    there = {path.name: path.read_text(encoding="utf-8") for path in PAGES.glob("*.md")}
    if "--check" in sys.argv:
        stale = sorted(name for name in wanted.keys() | there.keys() if wanted.get(name) != there.get(name))
        if stale:
            raise SystemExit(f"not current: {', '.join(stale)}; run scripts/reference.py")
        return
    PAGES.mkdir(exist_ok=True)
    for name in there.keys() - wanted.keys():
        (PAGES / name).unlink()
    for name, text in wanted.items():
        (PAGES / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
