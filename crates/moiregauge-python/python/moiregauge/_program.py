"""The command `moiregauge`: the same program as without Python."""

from __future__ import annotations

import sys


def main() -> int:
    """Runs the program with the arguments of this process."""
    from moiregauge import _core

    _core.calculated_by(_core.__file__)
    return _core.program(sys.argv)
