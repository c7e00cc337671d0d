"""Quantities in scene files: plain numbers in SI units, or strings such as "9 mm" that pint converts.

Which unit a number has stands at its field, as `Annotated[..., Unit("m")]`; the dataclass types are walked along with the
data, so that every file format made of them is covered. pint takes 0.3 s to import and is loaded at the first string.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from tokenize import TokenError
from typing import Annotated, Any, Final, get_args, get_origin, get_type_hints

from protocol.messages import EXTENT_MAX
from protocol.scene import Unit

from .lines import Path

WORDS: Final = {
    "m": ("a length", "9 mm"),
    "kg/m": ("a mass per length", "90 g/m"),
    "N m^2": ("a stiffness", "0.02 N m^2"),
    "s": ("a time", "20 ms"),
    "m/s": ("a speed", "20 mm/s"),
    "m/s^2": ("an acceleration", "-9.81 m/s^2"),
    "rad": ("an angle", "90 deg"),
    "N": ("a force", "12 kN"),
    "kg": ("a mass", "8 g"),
    "1/m": ("a curvature", "0.5 1/m"),
}
"""What a number in each unit is called, and an example of it as a string."""

_QUANTITY: Final = re.compile(r"\s*(?P<number>[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?)\s*(?P<unit>(?:(?:1\s*)?/\s*)?[^\W\d][\w ²³·*/^().-]*)")
_LIMITED: Final = ("m", "m/s^2")  # the messages carry positions and gravity below EXTENT_MAX only


@dataclass(frozen=True)
class Mistake:
    """Something wrong in a file: where, and what would be right."""

    path: Path
    text: str


def unit_of(hint: Any) -> str | None:
    """Unit that the type hint of a field carries, if any; looks through `| None`."""
    if get_origin(hint) is Annotated:
        for note in get_args(hint)[1:]:
            if isinstance(note, Unit):
                return note.name
        return None
    inner = {unit_of(member) for member in get_args(hint)} if type(None) in get_args(hint) else set()
    return next((unit for unit in inner if unit), None)


def plain(hint: Any) -> Any:
    """A type hint without its annotations and without `| None`."""
    while True:
        members = get_args(hint)
        if get_origin(hint) is Annotated:
            hint = members[0]
        elif type(None) in members:
            hint = next(member for member in members if member is not type(None))
        else:
            return hint


@cache
def fields_of(kind: Any) -> dict[str, Any]:
    """Names and type hints of the fields of a dataclass that a file may give."""
    hints = get_type_hints(kind, include_extras=True)
    return {field.name: hints[field.name] for field in fields(kind)}


def to_si(data: Any, hint: Any, path: Path = ()) -> tuple[Any, list[Mistake]]:
    """Data in which every string at a field with a unit has become a number in that unit, and what went wrong.

    Args:
        data: What tomllib read.
        hint: Type that the data are to have.
        path: Where the data stand in the file.
    """
    unit = unit_of(hint)
    if unit is not None:
        return _numbers(data, unit, path, single=plain(hint) is float)
    kind = plain(hint)
    if isinstance(kind, type) and is_dataclass(kind) and isinstance(data, dict):
        hints = fields_of(kind)
        parts = {key: to_si(value, hints[key], (*path, key)) if key in hints else (value, []) for key, value in data.items()}
        return {key: value for key, (value, _) in parts.items()}, [one for _, found in parts.values() for one in found]
    if get_origin(kind) is tuple and isinstance(data, list):
        members = get_args(kind)
        items = [to_si(value, members[0], (*path, index)) for index, value in enumerate(data)]
        return [value for value, _ in items], [one for _, found in items for one in found]
    if isinstance(data, float) and not math.isfinite(data):
        return data, [Mistake(path, f"{data} must be a finite number")]
    return data, []


def _numbers(data: Any, unit: str, path: Path, *, single: bool) -> tuple[Any, list[Mistake]]:
    """One number, or the three of a vector; what is neither is left for the validation to refuse."""
    if isinstance(data, list) and not single:
        items = [_numbers(value, unit, (*path, index), single=True) for index, value in enumerate(data)]
        return [value for value, _ in items], [one for _, found in items for one in found]
    if isinstance(data, str) and single:
        converted = _convert(data, unit)
        if isinstance(converted, str):
            return data, [Mistake(path, converted)]
        data = converted
    if isinstance(data, float | int) and not isinstance(data, bool):
        if not math.isfinite(data):
            return data, [Mistake(path, f"{data} {unit} must be finite")]
        if unit in _LIMITED and abs(data) >= EXTENT_MAX:
            return data, [Mistake(path, f"{data:g} {unit} must be below {EXTENT_MAX:g} {unit}")]
    return data, []


def _convert(text: str, unit: str) -> float | str:
    """A quantity in the unit, or the sentence that says why the text is none."""
    import pint

    word, example = WORDS.get(unit, (f"a quantity in {unit}", f"1 {unit}"))
    sentence = f"'{text}' is not {word}; give a number in {unit} or a string such as \"{example}\""
    match = _QUANTITY.fullmatch(text)
    if match is None:
        return sentence
    try:
        units = f"1{match['unit']}" if match["unit"].startswith("/") else match["unit"]  # "2 /m" is "2 1/m"
        return float(_registry().Quantity(float(match["number"]), units).to(unit).magnitude)
    except (pint.PintError, ValueError, TypeError, ArithmeticError, SyntaxError, AttributeError, AssertionError, TokenError):
        # pint's parser lets through what Python's tokenizer and arithmetic raise on a text that is no unit
        return sentence


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()
