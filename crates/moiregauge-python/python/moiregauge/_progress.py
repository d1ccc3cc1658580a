"""A bar on the screen, where nobody brings a better one."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TypeAlias

WIDTH = 30

Tell: TypeAlias = Callable[[str, int, int], object]
"""What is being done, how much of it is done, how much there is."""
Progress: TypeAlias = bool | Tell | None
"""`True` for a bar, or a function of what is being done, how much of it is done, and how much there is."""


class Bar:
    """One line that is written over: what is being done, how much of it is."""

    def __init__(self) -> None:
        self._open = False

    def __call__(self, doing: str, done: int, count: int) -> None:
        full = WIDTH if count == 0 else WIDTH * min(done, count) // count
        begin = "\r" if self._open else ""
        self._open = done < count
        end = "" if self._open else "\n"
        sys.stderr.write(f"{begin}{doing:<12}{'█' * full}{'·' * (WIDTH - full)} {done}/{count}{end}")
        sys.stderr.flush()


def teller(progress: Progress) -> Tell | None:
    """The function to call, if any."""
    if progress is None or progress is False:
        return None
    if progress is True:
        return Bar()
    if not callable(progress):
        raise TypeError(f"progress: expected True or a function of (doing, done, count), found {progress!r}")
    return progress
