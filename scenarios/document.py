"""A TOML file read into one of our dataclasses, or every mistake in it at once, one sentence each.

pydantic validates the types (0.1 s to import, loaded when the first file is read); the sentences are our own: file, line,
key, value, and what would be right.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from pathlib import Path as FilePath
from typing import Any, Final, TypeVar, get_args, get_origin

from protocol.effects import Wanted
from protocol.errors import SceneError

from .lines import Path, lines_of, nearest_line, written
from .override import override
from .quantity import WORDS, Mistake, fields_of, plain, to_si, unit_of
from .spelling import meant

T = TypeVar("T")

MISSPELT: Final = "unknown key; did you mean"

_PLURAL: Final = {float: "numbers", str: "texts in quotes", int: "whole numbers"}


class Document:
    """A TOML text with its overrides; knows on which line everything stands."""

    def __init__(self, name: str, text: str, settings: Sequence[str] = ()) -> None:
        self.name = name
        try:
            self.data: dict[str, Any] = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise SceneError(_syntax(name, str(error))) from error
        except RecursionError as error:
            raise SceneError(f"{name}: is nested too deep; a scene has tables of tables of numbers, no more") from error
        self._lines = lines_of(text)
        self._set, self._refused = override(self.data, settings)

    def read(self, kind: type[T], checks: Callable[[T], Iterable[Mistake]]) -> T:
        """The data as a `kind`, checked.

        Args:
            kind: A frozen dataclass whose fields carry units and bounds.
            checks: What else may be wrong once the types are right.

        Raises:
            SceneError: With one sentence a mistake, one a line.
        """
        data, unfit = to_si(self.data, kind)
        value, mistakes = _validate(data, kind, unfit)
        mistakes = self._refused + sorted(mistakes, key=lambda one: self._line(one.path) or 0)
        if value is not None and not mistakes:
            mistakes = list(checks(value))
        if mistakes or value is None:
            sentences = [self._sentence(one) for one in mistakes]
            raise SceneError("\n".join(dict.fromkeys(sentences)), key=written(mistakes[0].path))
        return value

    def _line(self, path: Path) -> int | None:
        return nearest_line(self._lines, path)

    def _sentence(self, mistake: Mistake) -> str:
        path = mistake.path
        key = f"{written(path)}: " if path else ""
        if mistake in self._refused or any(path[: len(made)] == made for made in self._set):
            return f"--set {key}{mistake.text}"
        line = self._line(path)
        return f"{self.name}:{line}: {key}{mistake.text}" if line else f"{self.name}: {key}{mistake.text}"


def read_text(file: FilePath) -> str:
    """The text of a file.

    Raises:
        SceneError: If it cannot be read; says why.
    """
    try:
        return file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise SceneError(f"{file}: is no text in UTF-8; save it as UTF-8", key=str(file)) from error
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise SceneError(f"{file}: cannot be read ({reason}); give the path of a .toml file", key=str(file)) from error


def _syntax(name: str, message: str) -> str:
    found = re.search(r"^(.*) \(at line (\d+), column (\d+)\)$", message, re.DOTALL)
    if found is None:
        return f"{name}: is no TOML: {message}"
    return f"{name}:{found[2]}: is no TOML: {found[1][:1].lower()}{found[1][1:]}, column {found[3]}"


def _validate(data: dict[str, Any], kind: type[T], unfit: list[Mistake]) -> tuple[T | None, list[Mistake]]:
    from pydantic import TypeAdapter, ValidationError

    try:
        # Strict JSON mode takes a list for a tuple and a word for an enum, but no text for a number and no number for a bool.
        value: T = TypeAdapter(kind).validate_json(json.dumps(data, default=str), strict=True)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        # pydantic calls a list too short when its elements are wrong; then their own sentences are enough.
        found = [_mistake(one, kind) for one in errors if not (one["type"] == "too_short" and one["input"])]
        found = _without_misspelt(found)
        known = {one.path for one in unfit}
        return None, unfit + [one for one in found if not any(one.path[:size] in known for size in range(len(one.path) + 1))]
    return value, unfit


def _without_misspelt(mistakes: list[Mistake]) -> list[Mistake]:
    """The mistakes without those keys that are missing because they are misspelt, which has a sentence of its own."""
    meant = {(*one.path[:-1], one.text.split("'")[1]) for one in mistakes if one.text.startswith(MISSPELT)}
    return [one for one in mistakes if not (one.path in meant and one.text.startswith("missing;"))]


def _mistake(error: Any, kind: Any) -> Mistake:
    """One error of pydantic in our words."""
    path: Path = tuple(error["loc"])
    for size in range(1, len(path) + 1):
        for wanted in (note for note in getattr(_hint_at(kind, path[:size]), "__metadata__", ()) if isinstance(note, Wanted)):
            return Mistake(path[:size], f"{_shown(error['input'])} is not right here; {wanted.sentence}")
    hint, given, sort = _hint_at(kind, path), error["input"], error["type"]
    limit = error.get("ctx", {})
    unit = f" {unit_of(hint)}" if unit_of(hint) else ""
    if sort in ("unexpected_keyword_argument", "extra_forbidden"):
        return Mistake(path, _unknown_key(str(path[-1]), plain(_hint_at(kind, path[:-1]))))
    parent = plain(_hint_at(kind, path[:-1])) if path else None
    if get_origin(parent) is tuple and ... not in get_args(parent) and sort == "missing":
        return Mistake(path[:-1], f"{len(given)} numbers are too few; {_expected(_hint_at(kind, path[:-1]))}")
    if sort == "missing":
        return Mistake(path, f"missing; {_expected(hint)}")
    if sort == "too_long":
        return Mistake(path, f"{len(given)} numbers are too many; {_expected(hint)}")
    if sort in ("too_short", "string_too_short"):
        return Mistake(path, f"must not be empty; {_expected(hint)}")
    if sort == "enum":
        return Mistake(path, _unknown_member(given, plain(hint)))
    for word, key in (("greater than", "gt"), ("at least", "ge"), ("at most", "le"), ("less than", "lt")):
        if key in limit:
            return Mistake(path, f"{given:g}{unit} must be {word} {limit[key]:g}{unit}")
    return Mistake(path, f"{_shown(given)} {_is_not(hint)}; {_expected(hint)}")


def _hint_at(kind: Any, path: Path) -> Any:
    """Type hint of the field at a path; `Any` where the types do not say."""
    for part in path:
        whole, kind = kind, plain(kind)
        if isinstance(kind, type) and is_dataclass(kind):
            kind = fields_of(kind).get(str(part), Any)
        elif get_origin(kind) is tuple:
            kind = float if unit_of(whole) is None and get_args(kind)[0] is float else _item(whole, kind)
        else:
            return Any
    return kind


def _item(whole: Any, kind: Any) -> Any:
    """Hint of one element of a tuple; a vector's numbers have the vector's unit."""
    from typing import Annotated

    from protocol.scene import Unit

    unit = unit_of(whole)
    return Annotated[get_args(kind)[0], Unit(unit)] if unit else get_args(kind)[0]


def _unknown_key(key: str, kind: Any) -> str:
    names = list(fields_of(kind)) if isinstance(kind, type) and is_dataclass(kind) else []
    close = meant(key, names)
    return f"{MISSPELT} '{close}'?" if close else f"unknown key; there are {', '.join(names)}"


def _unknown_member(given: Any, kind: Any) -> str:
    names = ", ".join(f"'{member.value}'" for member in kind)
    return f"{_shown(given)} unknown; there are {names}"


def _is_not(hint: Any) -> str:
    unit, kind = unit_of(hint), plain(hint)
    if unit and kind is float:
        return f"is not {WORDS.get(unit, (f'a quantity in {unit}',))[0]}"
    words = {float: "is not a number", str: "is not a text", int: "is not a whole number", bool: "is neither true nor false"}
    if isinstance(kind, type) and is_dataclass(kind):
        return "is not a table"
    return words.get(kind, "is not a list" if get_origin(kind) is tuple else "is not right here")


def _expected(hint: Any) -> str:
    """What to write for a field, as the end of a sentence."""
    unit, kind = unit_of(hint), plain(hint)
    if unit and kind is float:
        return f'give a number in {unit} or a string such as "{WORDS.get(unit, ("", f"1 {unit}"))[1]}"'
    if get_origin(kind) is tuple and ... not in get_args(kind):
        return f"give {len(get_args(kind))} numbers" + (f" in {unit}" if unit else "")
    if get_origin(kind) is tuple:
        inner = plain(get_args(kind)[0])
        return f"give a list of {'tables with ' + _keys(inner) if is_dataclass(inner) else _PLURAL.get(inner, 'values')}"
    if isinstance(kind, type) and is_dataclass(kind):
        return f"give a table with {_keys(kind)}"
    if isinstance(kind, type) and issubclass(kind, Enum):
        return f"give one of {', '.join(repr(member.value) for member in kind)}"
    words = {float: "give a number", str: "give a text in quotes", int: "give a whole number", bool: "give true or false"}
    return words.get(kind, "see the documentation")


def _keys(kind: Any) -> str:
    return ", ".join(field.name for field in fields(kind) if field.default is MISSING)


def _shown(value: Any) -> str:
    text = f"'{value}'" if isinstance(value, str) else json.dumps(value, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."
