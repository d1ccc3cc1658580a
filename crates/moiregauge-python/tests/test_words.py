"""What notebooks and terminals show, and that generated files are current."""

from __future__ import annotations

import ast
import graphlib
import inspect
import os
import pydoc
import subprocess
import sys
import sysconfig
from html.parser import HTMLParser
from pathlib import Path

import moiregauge as mg
import pytest

pytestmark = pytest.mark.filterwarnings("ignore::moiregauge.CaveatWarning")
HERE = Path(__file__).resolve().parent.parent


class Tags(HTMLParser):
    """Every tag that is opened is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.open.append(tag)
        self.seen.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.mark.parametrize("of", ["results", "map"])
def test_notebooks_show_a_table(of: str, scans: Path, image: Path) -> None:
    found = mg.analyze([scans]) if of == "results" else mg.map(image)
    html = found._repr_html_()
    tags = Tags()
    tags.feed(html)
    assert tags.open == [] and "table" in tags.seen and "script" not in tags.seen
    # Colours are those of the page, light or dark.
    assert "#" not in html.split("</style>")[0] and "currentColor" in html
    if of == "results":
        assert str(found.sets[0].mean.twist_deg) in html
        assert "Twist" in str(found) or "twist" in str(found)
        assert repr(found).startswith("<Results: 4 scans in 1 sets")


def test_names_are_no_html(scans: Path, tmp_path: Path) -> None:
    odd = tmp_path / "<script>alert(1)<" / "x.spm"
    odd.parent.mkdir(parents=True)
    odd.write_bytes((scans / "scan.000.spm").read_bytes())
    assert "<script" not in mg.analyze(odd)._repr_html_()


def test_generated_files_are_current() -> None:
    if not (HERE.parent / "moiregauge-report" / "schema").is_dir():
        pytest.skip("the schemas are not there")
    for script in ("generate.py", "reference.py"):
        subprocess.run([sys.executable, HERE / "scripts" / script, "--check"], check=True)


def test_modules_import_each_other_one_way() -> None:
    """Wherever an import stands: in functions, and for annotations alone."""
    files = {path.stem: path for path in (HERE / "python" / "moiregauge").glob("*.py")}

    def imported(path: Path) -> set[str]:
        found = set()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module == "moiregauge":
                found |= {one.name if one.name in files else "__init__" for one in node.names if one.name != "_core"}
            elif isinstance(node, ast.ImportFrom) and str(node.module).startswith("moiregauge."):
                found.add(str(node.module).split(".")[1])
            elif isinstance(node, ast.Import):
                found |= {one.name.partition(".")[2] or "__init__" for one in node.names if one.name.startswith("moiregauge")}
        return found

    order = graphlib.TopologicalSorter({name: imported(path) for name, path in files.items()})
    # Raises `CycleError`, with the circle in words.
    assert set(order.static_order()) >= set(files)


def test_arguments_stand_in_one_place_and_are_shown() -> None:
    one, several = inspect.signature(mg.analyze), inspect.signature(mg.analyze_moires)
    assert one.parameters == several.parameters and "arrays" in one.parameters
    assert (one.return_annotation, several.return_annotation) == ("Results", "list[Results]")
    assert "pixel_nm: 'float | tuple[float, float] | None' = None" in pydoc.render_doc(mg.analyze, renderer=pydoc.plaintext)


def test_types_are_right() -> None:
    pytest.importorskip("mypy")
    from mypy import api

    out, errors, code = api.run(["--strict", "--config-file", str(HERE / "pyproject.toml"), str(HERE / "python" / "moiregauge")])
    assert code == 0, out + errors
    done = subprocess.run([sys.executable, "-m", "mypy.stubtest", "moiregauge._core"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_types_are_right_for_pyright() -> None:
    """The package by itself, and what users see of it."""
    pytest.importorskip("pyright")
    scripts = sysconfig.get_path("scripts")
    # It looks for packages where an environment is active.
    here = {**os.environ, "VIRTUAL_ENV": sys.prefix, "PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}"}
    for arguments in (["--project", str(HERE)], ["--ignoreexternal", "--verifytypes", "moiregauge"]):
        done = subprocess.run(["pyright", *arguments], capture_output=True, text=True, env=here, cwd=scripts)
        assert done.returncode == 0, done.stdout + done.stderr
