"""Arguments that stand in one place."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def takes_what(other: Callable[P, object]) -> Callable[[Callable[..., T]], Callable[P, T]]:
    """Gives a function the arguments of another one: for checkers of types, for `help`, and for notebooks."""

    def like_other(function: Callable[..., T]) -> Callable[P, T]:
        back = inspect.signature(function).return_annotation
        told: Any = function
        told.__signature__ = inspect.signature(other).replace(return_annotation=back)
        return function

    return like_other
