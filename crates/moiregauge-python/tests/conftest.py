"""Simulated scans, made once by the program in the wheel."""

from __future__ import annotations

import shutil
import subprocess
import sysconfig
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

PROGRAM = Path(sysconfig.get_path("scripts")) / "moiregauge"


PASSED = pytest.StashKey[set[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--but-for", metavar="FILE", help="leave out the tests that FILE names; those that pass are written there")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    config.stash[PASSED] = set()
    file = config.getoption("--but-for")
    if not file or not Path(file).exists():
        return
    before = set(Path(file).read_text(encoding="utf-8").splitlines())
    config.hook.pytest_deselected(items=[item for item in items if item.nodeid in before])
    items[:] = [item for item in items if item.nodeid not in before]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if report.when == "call" and report.passed:
        item.config.stash[PASSED].add(item.nodeid)
    return report


def pytest_sessionfinish(session: pytest.Session) -> None:
    file = session.config.getoption("--but-for")
    if file and not Path(file).exists():
        Path(file).write_text("\n".join(sorted(session.config.stash[PASSED])), encoding="utf-8")


def program(*arguments: object, ok: bool = True) -> subprocess.CompletedProcess[str]:
    done = subprocess.run([str(PROGRAM), *map(str, arguments)], capture_output=True, text=True, timeout=300)
    assert not ok or done.returncode == 0, done.stderr
    return done


@pytest.fixture(scope="session")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A set of four scans, up and down in turn."""
    out = tmp_path_factory.mktemp("simulated")
    program("simulate", "--out", out, "--name", "set", "--scans", 4, "--pixels", 128, "--seed", 3)
    return out / "set"


@pytest.fixture(scope="session")
def image(scans: Path) -> Path:
    return scans / "scan.000.spm"


@pytest.fixture(scope="session")
def results(scans: Path) -> Any:
    import moiregauge as mg

    return mg.analyze([scans])


@pytest.fixture(scope="session")
def mapped(image: Path) -> Any:
    import moiregauge as mg

    return mg.map(image)


@pytest.fixture(scope="session")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty samples of two small scans each, one of them broken."""
    out = tmp_path_factory.mktemp("samples")
    program("simulate", "--out", out, "--name", "s000", "--scans", 2, "--pixels", 128, "--seed", 1)
    for number in range(1, 40):
        shutil.copytree(out / "s000", out / f"s{number:03}")
        # Other bytes: another sample.
        for scan in (out / f"s{number:03}").glob("*.spm"):
            content = bytearray(scan.read_bytes())
            content[-2:] = number.to_bytes(2, "little")
            scan.write_bytes(content)
    (out / "s007" / "scan.000.spm").write_bytes(b"\\*File list\r\n")
    return out


@pytest.fixture(scope="session")
def sets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two hundred simulated sets of two small scans each, no two alike."""
    import moiregauge as mg

    out = tmp_path_factory.mktemp("sets")
    raster = {"scans": 2, "pixels": [64, 64]}
    mg.simulate(out, sets=[{"name": f"s{number:03}", "seed": number, "raster": raster} for number in range(200)])
    return out
