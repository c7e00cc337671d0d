"""A scene as a file that the programs read: JSON in SI units, every default filled in, every path absolute.

`scenarios` writes it from a TOML scene, so that the environment needs neither pydantic nor pint.
"""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import msgspec
from annotated_types import Ge, Gt, Le, MinLen

from .errors import SceneError
from .scene import Scene, check_scene


def write(scene: Scene) -> bytes:
    """The scene as readable JSON."""
    return msgspec.json.format(msgspec.json.encode(scene), indent=2) + b"\n"


def read(data: bytes) -> Scene:
    """The scene that the bytes hold, with its types, bounds and references checked.

    Raises:
        SceneError: If the bytes are no scene; names the key.
    """
    try:
        scene = msgspec.json.decode(data, type=Scene)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise SceneError(f"not a resolved scene: {error}; write one with 'cablecosim check SCENE --resolve FILE.json'") from error
    _check_fields(msgspec.json.decode(data), msgspec.to_builtins(scene), "")
    check_bounds(scene)
    check_scene(scene)
    return scene


def _check_fields(given: Any, known: Any, key: str) -> None:
    """Refuse a field that the scene types do not have, wherever it stands."""
    if isinstance(given, dict):
        for name, value in given.items():
            place = f"{key}.{name}" if key else name
            if name not in known:
                raise SceneError(f"{place}: unknown key; there are {', '.join(known)}", key=place)
            _check_fields(value, known[name], place)
    elif isinstance(given, list):
        for index, (value, same) in enumerate(zip(given, known, strict=True)):
            _check_fields(value, same, f"{key}[{index}]")


def check_bounds(value: Any, key: str = "") -> None:
    """Check every number of a scene, or of a part of one, against the bounds at its field.

    Raises:
        SceneError: Names the key, its value and the bound.
    """
    hints = get_type_hints(type(value), include_extras=True)
    for field in fields(value):
        place = f"{key}.{field.name}" if key else field.name
        item = getattr(value, field.name)
        if item is None:
            continue
        _check(item, place, _bounds(hints[field.name]))
        for index, part in enumerate(item if isinstance(item, tuple) else ()):
            if is_dataclass(part):
                check_bounds(part, f"{place}[{index}]")
            else:
                _check(part, f"{place}[{index}]", [])
        if is_dataclass(item):
            check_bounds(item, place)


def _bounds(hint: Any) -> list[Any]:
    """Bounds at a field, also those inside `Annotated[...] | None`."""
    inner = [bound for member in get_args(hint) if type(None) in get_args(hint) for bound in _bounds(member)]
    return list(get_args(hint)[1:]) if get_origin(hint) is Annotated else inner


def _check(item: Any, key: str, bounds: list[Any]) -> None:
    if isinstance(item, float) and not math.isfinite(item):
        raise SceneError(f"{key}: {item} must be finite", key=key)
    for bound in bounds:
        match bound:
            case Gt(gt=limit) if not item > limit:
                raise SceneError(f"{key}: {item:g} must be greater than {limit:g}", key=key)
            case Ge(ge=limit) if not item >= limit:
                raise SceneError(f"{key}: {item:g} must be at least {limit:g}", key=key)
            case Le(le=limit) if not item <= limit:
                raise SceneError(f"{key}: {item:g} must be at most {limit:g}", key=key)
            case MinLen(min_length=least) if len(item) < least:
                raise SceneError(f"{key}: must not be empty", key=key)
