"""Writes `results.py` and `_options.py` of the package from the published schemas: `python scripts/generate.py`.

`--check` writes nothing and fails where the file is not current. Needs Python alone.
"""

from __future__ import annotations

import json
import sys
import textwrap
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent.parent
SCHEMAS = HERE.parent / "moiregauge-report" / "schema"
PACKAGE = HERE / "python" / "moiregauge"
DOCUMENTS = ["results-1", "map-1"]

HEAD = '''"""What analyses and maps find: frozen dataclasses of the published documents, with units in the names.

Made by `scripts/generate.py` from `crates/moiregauge-report/schema`; not to be edited.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from moiregauge._base import EstimateBase, MapBase, ResultsBase
from moiregauge._document import Document, decoded_by, several
'''

# Bases that add what data cannot do.
BASES = {"Estimate": "EstimateBase", "Results": "ResultsBase", "MapResults": "MapBase"}
# Names that the schemas had to number.
NAMES = {"Calibration2": "ScannerCalibration"}

Schema = dict[str, Any]


def type_of(schema: Schema) -> str:
    """The annotation of a property."""
    if "$ref" in schema:
        name: str = schema["$ref"].rsplit("/", 1)[1]
        return NAMES.get(name, name)
    if "anyOf" in schema:
        return " | ".join(type_of(one) for one in schema["anyOf"])
    if "oneOf" in schema:
        return "Literal[" + ", ".join(json.dumps(one["const"]) for one in schema["oneOf"]) + "]"
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    return " | ".join(plain(kind, schema) for kind in kinds)


def plain(kind: str, schema: Schema) -> str:
    if kind == "array":
        item = type_of(schema["items"])
        least, most = schema.get("minItems"), schema.get("maxItems")
        if least is not None and least == most:
            return "tuple[" + ", ".join([item] * least) + "]"
        return f"tuple[{item}, ...]"
    words = {"number": "float", "integer": "int", "boolean": "bool", "string": "str", "null": "None"}
    return words[kind]


def default_of(annotation: str) -> str:
    """What a property is that a document may leave out."""
    if annotation.startswith("tuple") and annotation.endswith("...]"):
        return "()"
    return "None"


def decoder_of(schema: Schema, classes: dict[str, Schema]) -> str | None:
    """What makes a value of this property, as code; `None` where it stays as it is."""
    if "$ref" in schema:
        name = type_of(schema)
        return f"{name}.from_dict" if "properties" in classes[name] else decoder_of(classes[name], classes)
    if "anyOf" in schema:
        return next(filter(None, (decoder_of(one, classes) for one in schema["anyOf"])), None)
    if "oneOf" in schema:
        return None
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    if "array" not in kinds:
        return "float" if "number" in kinds else None
    count = [str(schema["minItems"])] if schema.get("minItems", 0) == schema.get("maxItems") else []
    return f"several({', '.join([str(decoder_of(schema['items'], classes)), *count])})"


def decoders(classes: dict[str, Schema]) -> str:
    """The table of what makes the fields of all classes."""
    out = ["decoded_by(", "    {"]
    for name in sorted(name for name, schema in classes.items() if "properties" in schema):
        found = {key: decoder_of(of, classes) for key, of in classes[name]["properties"].items()}
        made = "".join(f'            "{key}": {decoder},\n' for key, decoder in found.items() if decoder)
        out.append(f"        {name}: {{\n{made}        }}," if made else f"        {name}: {{}},")
    return "\n".join([*out, "    }", ")"]) + "\n"


def doc(text: str, indent: str) -> str:
    words = " ".join(text.replace("\\", "\\\\").split())
    if len(words) + len(indent) + 6 <= 110:
        return f'{indent}"""{words}"""'
    lines = textwrap.wrap(words, 110 - len(indent) - 3)
    return f'{indent}"""' + f"\n{indent}".join(lines) + f'\n{indent}"""'


def class_of(name: str, schema: Schema) -> str:
    base = BASES.get(name, "Document")
    # Maps compare their arrays, too.
    settings = "frozen=True, kw_only=True"
    settings += ", eq=False" if base == "MapBase" else ""
    settings += ", repr=False" if base != "Document" else ""
    out = [f"@dataclass({settings})", f"class {name}({base}):", doc(schema.get("description", name), "    "), ""]
    required = set(schema.get("required", []))
    for key, of in schema["properties"].items():
        annotation = type_of(of)
        if key not in required:
            default = default_of(annotation)
            if default == "None" and "None" not in annotation.split(" | "):
                annotation += " | None"
            out.append(f"    {key}: {annotation} = {default}")
        else:
            out.append(f"    {key}: {annotation}")
        if "description" in of:
            out.append(doc(of["description"], "    "))
    return "\n".join(out) + "\n"


def generated() -> str:
    classes: dict[str, Schema] = {}
    for document in DOCUMENTS:
        schema = json.loads((SCHEMAS / f"{document}.schema.json").read_text(encoding="utf-8"))
        defs = dict(schema["$defs"])
        defs[schema["title"]] = {k: v for k, v in schema.items() if k != "$defs"}
        for name, of in defs.items():
            name = NAMES.get(name, name)
            if classes.setdefault(name, of) != of:
                sys.exit(f"{name} means two things in the schemas: give one of them another name")
    aliases, bodies = [], []
    for name in sorted(classes):
        schema = classes[name]
        if "properties" in schema:
            bodies.append(class_of(name, schema))
        else:
            aliases.append(f"{name} = {type_of(schema)}\n{doc(schema.get('description', name), '')}\n")
    names = "".join(f'    "{name}",\n' for name in sorted(classes))
    parts = [HEAD, f"__all__ = [\n{names}]\n", "\n".join(aliases), "\n\n".join(bodies)]
    return "\n".join(parts[:2]) + "\n" + parts[2] + "\n\n" + parts[3] + "\n\n" + decoders(classes)


OPTIONS_HEAD = '''"""Options of an analysis: the settings of the program, and what files do not tell.

Made by `scripts/generate.py` from `crates/moiregauge-report/schema`; not to be edited.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

'''

# What may be given in other words than those of the document.
GIVEN = {
    "material": "str | Mapping[str, Any]",
    "substrate": "str | Mapping[str, Any]",
    "moire_layers": "Sequence[str | Mapping[str, Any]]",
    "drift": "tuple[float, float] | Mapping[str, float]",
    "frame_direction": "FrameOrder | Sequence[Literal['up', 'down']]",
    "sensors": "str",
    "scanner": "str | Mapping[str, Any]",
}
# Not for people.
HIDDEN = {"layers_chosen"}
MORE = {
    "layers": ("str", "The layers by name: `graphene`, or `graphene/hBN` for graphene on hBN."),
    "ruler_from": (
        "str | Sequence[str]",
        "Frames of the same scanner that show the atoms of a layer, at another magnification: they calibrate it, in place of `scanner`. "
        "Of layer 2, or of that which `ruler` names.",
    ),
    "settings": (
        "str | Mapping[str, Any]",
        "A file of settings (TOML), one of results, or settings that results hold; other options come on top of it.",
    ),
}


def loose(annotation: str, classes: set[str]) -> str:
    """Lists for tuples, dictionaries for dataclasses."""
    annotation = annotation.replace(" | None", "")
    if annotation in classes:
        return "Mapping[str, Any]"
    return f"Sequence[{annotation[6:-6]}]" if annotation.endswith(", ...]") else annotation


def options() -> str:
    defs = json.loads((SCHEMAS / "results-1.schema.json").read_text(encoding="utf-8"))["$defs"]
    classes = {NAMES.get(name, name) for name, of in defs.items() if "properties" in of}
    aliases = {name: type_of(of) for name, of in defs.items() if "properties" not in of}
    entries = dict(MORE)
    known = []
    for table in ("Settings", "UserSpecified"):
        for name, of in defs[table]["properties"].items():
            if name in HIDDEN:
                continue
            entries[name] = (GIVEN.get(name) or loose(type_of(of), classes), of.get("description", ""))
            if table == "UserSpecified":
                known.append(name)
    used = [name for name in sorted(aliases) if any(name in annotation for annotation, _ in entries.values())]
    out = [OPTIONS_HEAD + "".join(f"{name} = {aliases[name]}\n" for name in used)]
    out.append(f"\nTOLD = {known!r}\n".replace("'", '"'))
    out.append("\nclass Options(TypedDict, total=False):")
    out.append('    """Keyword arguments of `analyze`, `measure`, `map`, `Campaign` and `campaign.run`.\n')
    for name in sorted(entries):
        words = " ".join(f"{name}: {entries[name][1]}".split())
        out.append(textwrap.fill(words, 110, initial_indent="    ", subsequent_indent="        "))
    out.append('    """\n')
    out += [f"    {name}: {entries[name][0]}" for name in sorted(entries)]
    return "\n".join(out) + "\n"


def main() -> None:
    for name, text in (("results.py", generated()), ("_options.py", options())):
        target = PACKAGE / name
        if "--check" not in sys.argv[1:]:
            target.write_text(text, encoding="utf-8")
        elif target.read_text(encoding="utf-8") != text:
            sys.exit(f"{target} is not current: run {Path(__file__).name}")


if __name__ == "__main__":
    main()
