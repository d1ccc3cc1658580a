"""Parts of published documents: frozen, made of plain dictionaries, and such again."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias, TypeVar, cast

T = TypeVar("T", bound="Document")

# What makes a value of a document one of ours.
Decoder: TypeAlias = Callable[[Any], Any]

# Those of the fields of every class that do not stay as they are; a table, since reading annotations takes as long as
# reading ten documents.
_DECODERS: dict[type[Document], Mapping[str, Decoder]] = {}


def decoded_by(table: Mapping[type[Document], Mapping[str, Decoder]]) -> None:
    """Tells what makes the fields of classes."""
    _DECODERS.update(table)


def several(decoder: Decoder | None, count: int | None = None) -> Decoder:
    """What makes a tuple of a list, of so many values if that is said."""

    def made(values: Sequence[Any]) -> tuple[Any, ...]:
        if count is not None and len(values) != count:
            raise ValueError(f"expected {count} values, found {len(values)}: {values}")
        if decoder is None:
            return tuple(values)
        return tuple([None if value is None else decoder(value) for value in values])

    return made


def _encoded(value: Any) -> Any:
    if isinstance(value, Document):
        return value.to_dict()
    if isinstance(value, tuple):
        return [_encoded(one) for one in value]
    return value


# Names of the fields of every class that was met, and what they are where a document leaves them out.
_FIELDS: dict[type[Document], list[tuple[str, Any]]] = {}


def _decoders(of: type[Document]) -> Mapping[str, Decoder]:
    # A class made of one of ours has its fields.
    return next((_DECODERS[one] for one in of.__mro__ if one in _DECODERS), {})


def _fields(of: type[Document]) -> list[tuple[str, Any]]:
    if of not in _FIELDS:
        _FIELDS[of] = [(field.name, field.default) for field in dataclasses.fields(cast(Any, of))]
    return _FIELDS[of]


class Document:
    """A part of a published document. Frozen; compared by value; no reference to a file or an image."""

    @classmethod
    def from_dict(cls: type[T], document: Mapping[str, Any]) -> T:
        """That of a document, as `results.json` holds it.

        Raises `ValueError` for names that this version does not know.
        """
        known = cast(Any, cls).__dataclass_fields__.keys()
        if not document.keys() <= known:
            raise ValueError(f"{cls.__name__}: expected {sorted(known)}, found also {sorted(document.keys() - known)}")
        given = dict(document)
        for name, decoder in _decoders(cls).items():
            value = given.get(name)
            if value is not None:
                given[name] = decoder(value)
        return cls(**given)

    def to_dict(self) -> dict[str, Any]:
        """The document as plain dictionaries, lists, numbers and words: that of `results.json` or `map.json`."""
        document = {}
        for name, default in _fields(type(self)):
            value = getattr(self, name)
            # What a document may leave out is left out where there is none.
            if default is dataclasses.MISSING or value != default:
                document[name] = _encoded(value)
        return document
