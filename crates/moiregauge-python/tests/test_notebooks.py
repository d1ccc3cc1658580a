"""The notebooks of the documentation run as they are."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).resolve().parents[3] / "docs" / "notebooks"


@pytest.mark.parametrize("path", sorted(NOTEBOOKS.glob("*.py")), ids=lambda path: path.stem)
def test_notebooks_run(path: Path, tmp_path: Path) -> None:
    for needed in ("matplotlib", "pandas", "xarray", "netCDF4"):
        pytest.importorskip(needed)
    environment = {**os.environ, "MPLBACKEND": "agg", "PYTHONWARNINGS": "ignore"}
    done = subprocess.run(
        [sys.executable, path], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_there_are_notebooks() -> None:
    assert len(list(NOTEBOOKS.glob("*.py"))) == 4


def test_a_kernel_is_interrupted_and_goes_on(scans: Path) -> None:
    """As the button of a notebook does it, in the middle of work that would take hours."""
    pytest.importorskip("ipykernel")
    client = pytest.importorskip("jupyter_client")

    def said(code: str, when_it_works: Callable[[], None] | None = None) -> str:
        """What a cell prints, or the name of its error."""
        asked, words = talk.execute(code), []
        while True:
            message = talk.get_iopub_msg(timeout=120)
            content = message["content"]
            if message["parent_header"].get("msg_id") != asked:
                continue
            if message["msg_type"] == "status" and content["execution_state"] == "idle":
                return "".join(words)
            words.append(content.get("text") or content.get("ename") or "")
            if when_it_works is not None and "it works" in words[-1]:
                when_it_works()
                when_it_works = None

    manager, talk = client.manager.start_new_kernel(kernel_name="python3")
    try:
        head = "import warnings; warnings.simplefilter('ignore'); import moiregauge as mg; "
        # Interrupted when progress says that it is in the middle of it.
        tell = "lambda doing, done, count: print('it works' if 0 < done < count else '', flush=True)"
        assert "KeyboardInterrupt" in said(f"{head}mg.validate(sets=100000, progress={tell})", manager.interrupt_kernel)
        assert said(f"print(len(mg.analyze({str(scans)!r}).sets[0].scans))").strip() == "4"
    finally:
        talk.stop_channels()
        manager.shutdown_kernel(now=True)
