"""Compiled functions as plain Python, for as long as their compiled code is not ready."""

from __future__ import annotations

from collections.abc import Mapping
from types import FunctionType
from typing import Any


def interpreted(functions: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """The Python functions that numba would compile, by name, and all that they call.

    Args:
        functions: Compiled functions by name.
        given: Functions that take the place of compiled ones of the same name, wherever those are called.
    """
    made: dict[Any, Any] = {}

    def plain(function: Any) -> Any:
        source = function.py_func
        if source.__name__ in given:
            return given[source.__name__]
        if source not in made:
            names = dict(source.__globals__)
            made[source] = FunctionType(source.__code__, names, source.__name__, source.__defaults__)
            for name in source.__code__.co_names:
                if hasattr(names.get(name), "py_func"):
                    names[name] = plain(names[name])
        return made[source]

    return {name: plain(function) for name, function in functions.items()}
