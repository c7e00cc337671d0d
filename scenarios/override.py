"""Overrides from the command line: `cable.bending=0.01` put into the data of a file before they are validated."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from typing import Any

from .lines import Path, written
from .quantity import Mistake
from .spelling import meant


def override(data: dict[str, Any], settings: Sequence[str]) -> tuple[set[Path], list[Mistake]]:
    """Change the data in place; return the paths that were set, and what could not be.

    The key of a setting has dots: `time_step`, `cables.0.bending`, `cables.trunk.bending` by name, or `cable.bending`
    where there is one cable. The value is TOML; what is no TOML is a string, so that `cable.diameter=9 mm` works.
    """
    paths: set[Path] = set()
    mistakes: list[Mistake] = []
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not equals or not key.strip():
            mistakes.append(Mistake((), f"'{setting}' is no setting; give one such as cable.bending=0.01"))
            continue
        place = _place(data, key.strip())
        if isinstance(place, str):
            mistakes.append(Mistake((), place))
            continue
        table, path = place
        table[path[-1]] = _value(text.strip())
        paths.add(path)
    return paths, mistakes


def _value(text: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return parsed["value"] if len(parsed) == 1 else text


def _place(data: dict[str, Any], key: str) -> tuple[Any, Path] | str:
    """The table or list that a dotted key sets something in, with the key's path; or why there is none."""
    path: Path = ()
    here: Any = data
    parts = key.split(".")
    for number, part in enumerate(parts):
        last = number == len(parts) - 1
        if isinstance(here, dict) and part not in here and not last and isinstance(here.get(_plural(part)), list):
            items = here[_plural(part)]
            if len(items) != 1:
                one = ".".join([*parts[:number], _plural(part), *_names(items)[:1], *parts[number + 1 :]])
                return f"{key}: there are {len(items)} {_plural(part)}; say which, such as {one}" if items else f"{key}: there is no {part}"
            here, path = items[0], (*path, _plural(part), 0)
        elif isinstance(here, list):
            index = _index(here, part)
            if index is None:
                return f"{key}: '{part}' unknown; there are {', '.join(repr(name) for name in _names(here)) or 'none'}"
            path = (*path, index)
            if last:
                return here, path
            here = here[index]
        elif not isinstance(here, dict):
            return f"{key}: {written(path)} holds {here!r} and no table; nothing lies below it"
        else:
            path = (*path, part)
            if last:
                return here, path
            if part not in here:
                return f"{key}: '{part}' unknown{_close(part, list(here))}"
            here = here[part]
    return f"{key}: names a whole table; name one of its keys, such as {key}.{_first_key(here)}"


def _plural(word: str) -> str:
    return f"{word[:-1]}ies" if word.endswith("y") else f"{word}es" if word.endswith("s") else f"{word}s"


def _names(items: list[Any]) -> list[str]:
    return [str(item["name"]) if isinstance(item, dict) and "name" in item else str(index) for index, item in enumerate(items)]


def _index(items: list[Any], part: str) -> int | None:
    if part.isdecimal() and int(part) < len(items):
        return int(part)
    return next((index for index, name in enumerate(_names(items)) if name == part and not part.isdecimal()), None)


def _close(part: str, keys: list[str]) -> str:
    close = meant(part, [*keys, *(key.removesuffix("s") for key in keys)])
    return f"; did you mean '{close}'?" if close else f"; there are {', '.join(repr(key) for key in keys)}"


def _first_key(table: Any) -> str:
    return str(next(iter(table))) if isinstance(table, dict) and table else "key"
