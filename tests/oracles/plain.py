"""Compiled functions as they stand in Python: nothing is compiled for a test's sake."""

from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])

_known: dict[Any, Any] = {}


def plain(function: F) -> F:
    """The same function in Python, and all compiled ones that it calls."""
    inner = getattr(function, "__wrapped__", None)
    if inner is None:  # machine code is turned off
        return function
    if function not in _known:
        names: dict[str, Any] = {}
        made = FunctionType(inner.__code__, names, inner.__name__, inner.__defaults__)
        _known[function] = made
        names.update(inner.__globals__)
        for name in inner.__code__.co_names:
            value = names.get(name)
            if hasattr(value, "__wrapped__") and not isinstance(value, type):
                names[name] = plain(cast(Any, value))
    return cast(F, _known[function])
