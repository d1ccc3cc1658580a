"""Errors and warnings."""

from __future__ import annotations

from collections.abc import Sequence


class _FileError(ValueError):
    """An error about files."""

    def __init__(self, message: str, failed: Sequence[tuple[str, str]] = ()) -> None:
        super().__init__(message)
        self.failed: list[tuple[str, ...]] = [tuple(one) for one in failed]
        """Every file that failed, and why."""
        self.file: str | None = self.failed[0][0] if self.failed else None
        """The file it is about; the first of `failed`."""

    def __reduce__(self) -> tuple[type[_FileError], tuple[str, list[tuple[str, ...]]]]:
        return type(self), (str(self), self.failed)


class ReadError(_FileError):
    """A file cannot be read: it is missing, damaged, or no scan."""


class MeasureError(_FileError):
    """An image shows no lattice that could be measured."""


class CaveatWarning(UserWarning):
    """A doubt about results; the same as in `results.caveats`, where each has a code, a place and a message."""


class FailedFileWarning(UserWarning):
    """Some of the files could not be used; `results.failed` has all of them with the reasons."""
