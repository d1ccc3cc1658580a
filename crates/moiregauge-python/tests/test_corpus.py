"""Recorded and simulated files: the numbers of the package and of the program are the same bytes.

`MOIREGAUGE_CORPUS=all` compares the results and maps of all files, else of each fourth.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import moiregauge as mg
import pytest
from conftest import program
from moiregauge import _core

pytestmark = pytest.mark.filterwarnings("ignore::moiregauge.CaveatWarning", "ignore::moiregauge.FailedFileWarning")

DATA = Path(os.environ.get("MOIREGAUGE_TESTDATA") or Path(__file__).resolve().parents[4] / "shared" / "data")
# What is no scan, beside scans.
WORDS = (".json", ".md", ".txt")
SIZE_NM = (200.0, 200.0)
TABLES = ("scans.csv", "sets.csv", "vectors.csv", "budget.csv", "columns.md")


def corpus() -> list[tuple[Path, dict[str, Any]]]:
    """Folders of sets, whose arrays do not tell their size, and single files."""
    sets = [path for path in sorted([*DATA.glob("sets/*"), *DATA.glob("hard/*")]) if path.is_dir()]
    files = [path for path in sorted(DATA.glob("real/**/*")) if path.is_file() and path.suffix not in WORDS]
    return [(path, {"size_nm": SIZE_NM}) for path in sets] + [(path, {}) for path in files]


def some() -> list[tuple[Path, dict[str, Any]]]:
    """Each fourth, unless all are asked for: all take minutes."""
    return corpus()[:: 1 if os.environ.get("MOIREGAUGE_CORPUS") == "all" else 4]


def test_the_corpus_is_there() -> None:
    if not corpus():
        assert os.environ.get("MOIREGAUGE_REQUIRE_TESTDATA") != "1", f"no test data in {DATA}"
        pytest.skip(f"no test data in {DATA}")


def without_run(document: Any) -> str:
    """A document, as bytes would have it, without what tells how it was asked for."""
    document["provenance"].pop("run", None)
    return json.dumps(document, sort_keys=True)


@pytest.mark.parametrize(("path", "options"), some(), ids=lambda one: one.name if isinstance(one, Path) else "")
@pytest.mark.parametrize("command", ["analyze", "map"])
def test_numbers_are_the_same_bytes(command: str, path: Path, options: dict[str, Any], tmp_path: Path) -> None:
    told = ["--size", "{}nm×{}nm".format(*options["size_nm"])] if options else []
    plain = ["--no-report"] if command == "analyze" else ["--no-png"]
    done = program(command, path, *told, "--out", tmp_path / "out", *plain, ok=False)
    document = tmp_path / "out" / ("results.json" if command == "analyze" else "map.json")
    try:
        found = mg.analyze(path, **options) if command == "analyze" else mg.map(path, **options)
    except (mg.ReadError, mg.MeasureError) as error:
        # The program refuses it as well, and for the same reason.
        assert not document.exists() and done.returncode != 0
        assert all(why in done.stderr for _, why in error.failed), (error.failed, done.stderr)
        return
    assert document.is_file(), done.stderr
    assert without_run(found.to_dict()) == without_run(json.loads(document.read_text(encoding="utf-8")))
    if command == "analyze":
        tables = dict(_core.tables(json.dumps(found.to_dict())))
        assert {name: (tmp_path / "out" / name).read_bytes() for name in TABLES} == {
            name: tables[name].encode() for name in TABLES
        }


@pytest.mark.parametrize("path", [path for path, options in corpus() if not options], ids=lambda path: path.name)
def test_files_are_described_alike(path: Path) -> None:
    said = program("info", "--json", path, ok=False)
    try:
        found = mg.inspect(path)
    except mg.ReadError:
        assert said.returncode != 0
        return
    assert [one.to_dict() for one in found] == json.loads(said.stdout)
