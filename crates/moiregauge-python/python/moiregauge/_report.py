"""Reports, as the program writes them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from moiregauge import _core
from moiregauge._progress import Progress, teller


def write(
    run: _core.Analysis,
    folder: Path,
    force: bool,
    choice: Mapping[str, Any],
    parquet: bool,
    threads: int | None,
    progress: Progress,
) -> Path:
    """That of an analysis; returns the page, or the document where no page was wanted."""
    moires = run.report(folder, force, json.dumps(choice), parquet, threads, teller(progress))
    within = folder / "moire-1" if moires > 1 else folder
    return within / ("report.html" if choice["html"] else "results.json")


def write_map(
    made: _core.Map, folder: Path, force: bool, choice: Mapping[str, Any], threads: int | None, progress: Progress
) -> Path:
    """That of a map; returns the page, or the document where no page was wanted."""
    made.report(folder, force, json.dumps(choice), threads, teller(progress))
    return folder / ("report.html" if choice["html"] else "map.json")


def run_again(document: Mapping[str, Any], threads: int | None, progress: Progress) -> _core.Analysis:
    """The run that results record, done again."""
    recorded = document["provenance"].get("run")
    if recorded is None:
        raise ValueError("the results do not record their run: they cannot be reported again")
    beside = {key: recorded.get(key) for key in ("arguments", "atomic", "survey_image")}
    run = _core.Analysis(
        [Path(path) for path in recorded["inputs"]],
        json.dumps({"settings": recorded["settings"]}),
        json.dumps(recorded["known"]),
        json.dumps({**beside, "sets": recorded.get("sets", [])}),
        [],
    )
    again = [json.loads(one) for one, _ in run.analyse(threads, teller(progress))]
    if document not in again:
        raise ValueError("the same run does not come to these results any more: its files or this version have changed")
    return run
