"""Answers that have no published schema: JSON with attributes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any


def _plain(value: Any) -> Any:
    if isinstance(value, Record):
        return value.to_dict()
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    return value


def _wrapped(value: Any) -> Any:
    if isinstance(value, dict):
        return Record(value)
    if isinstance(value, list):
        return tuple(_wrapped(one) for one in value)
    return value


class Record(Mapping[str, Any]):
    """A document: its entries are attributes and items. Cannot be changed; compared by value; can be pickled."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.__dict__["_entries"] = {name: _wrapped(value) for name, value in document.items()}

    def __getattr__(self, name: str) -> Any:
        # Asked for while it is made again from a pickle, too.
        entries = self.__dict__.get("_entries", {})
        if name in entries:
            return entries[name]
        raise AttributeError(f"no entry {name!r}; there are {list(entries)}")

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"cannot set {name!r}: answers do not change")

    def __getitem__(self, name: str) -> Any:
        return self.__dict__["_entries"][name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.__dict__["_entries"])

    def __len__(self) -> int:
        return len(self.__dict__["_entries"])

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __reduce__(self) -> tuple[type[Record], tuple[dict[str, Any]]]:
        return Record, (self.to_dict(),)

    def __repr__(self) -> str:
        return f"Record({self.to_dict()!r})"

    def to_dict(self) -> dict[str, Any]:
        """The document as plain dictionaries, lists, numbers and words."""
        return {name: _plain(value) for name, value in self.items()}
