"""The Python blocks of the pages run as they are, one after the other, beside simulated scans."""

from __future__ import annotations

import re
import shutil
import warnings
from pathlib import Path

import moiregauge as mg
import pytest
from conftest import program

ROOT = Path(__file__).resolve().parents[3]
PAGES = [
    "README.md",
    "crates/moiregauge-python/README.md",
    "docs/tutorials/python.md",
    "docs/tutorials/maps.md",
]


def blocks(page: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), re.M | re.S)


def arrays(scans: Path) -> dict[str, object]:
    """What a reader would have in memory: the arrays that the page on Python names."""
    up, down = (mg.read(scans / f"scan.00{n}.spm") for n in (0, 1))

    def values(scan: mg.Scan, name: str, line: str = "trace") -> object:
        return next(c.values for c in scan.channels if c.name == name and c.line_direction in (line, None))

    return {
        "a": values(up, "TR Phase"),
        "b": values(up, "TR Phase", "retrace"),
        "x": values(up, "Xsensor"),
        "y": values(up, "Ysensor"),
        "up": values(up, "TR Phase"),
        "down": values(down, "TR Phase"),
    }


@pytest.mark.parametrize("page", PAGES)
def test_blocks_run(page: str, scans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for needed in ("matplotlib", "pandas", "xarray", "zarr"):
        pytest.importorskip(needed)
    shutil.copytree(scans, tmp_path / "scans")
    for name in ("scan.000.spm", "scan.001.spm"):
        shutil.copy(scans / name, tmp_path)
    program("simulate", "--out", tmp_path / "samples", "--name", "one", "--scans", 2, "--pixels", 128)
    if "map.zarr" in (ROOT / page).read_text(encoding="utf-8"):
        program("map", tmp_path / "scan.000.spm", "--out", tmp_path / "maps")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names = arrays(scans)
    found = blocks(page)
    assert found
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for block in found:
            exec(compile(block, page, "exec"), names)  # noqa: S102
    # What pages leave open is no figure of the package.
    import matplotlib.pyplot

    matplotlib.pyplot.close("all")


def test_no_page_is_forgotten() -> None:
    """Every page with a block is run, but for those of reference, whose blocks are signatures."""
    reference = ROOT / "docs" / "python"
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("crates/*/*.md")]
    having = {p for p in pages if p.parent != reference and "\n```python\n" in p.read_text(encoding="utf-8")}
    assert {p.relative_to(ROOT).as_posix() for p in having} == set(PAGES)
