"""The scene file as a JSON Schema, for editors: keys, units, bounds and choices, from the types that the file is read by."""

from __future__ import annotations

from dataclasses import is_dataclass
from typing import Any, Final, get_args

from protocol.cable import Cable, LumpedMass, Section
from protocol.scene import Arm, Body, Gripper, Move, Picture, Relaxation, Robot, Scene, Target

from .quantity import WORDS, fields_of, plain, unit_of

DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
TABLES: Final = (Scene, Cable, Section, LumpedMass, Gripper, Body, Robot, Arm, Move, Target, Picture, Relaxation)


def schema() -> dict[str, Any]:
    """The schema of a scene file, in which a number with a unit may also be a string such as "9 mm"."""
    from pydantic import TypeAdapter

    found = TypeAdapter(Scene).json_schema(ref_template="#/$defs/{model}")
    tables = {kind.__name__: kind for kind in TABLES}
    for name, table in ((Scene.__name__, found), *found["$defs"].items()):
        kind = tables.get(name)
        if kind is not None:
            table["description"] = (kind.__doc__ or "").partition("\n")[0]
            for key, hint in fields_of(kind).items():
                table["properties"][key] = _with_unit(table["properties"][key], hint)
    return {"$schema": DIALECT, **found}


def _with_unit(written: dict[str, Any], hint: Any) -> dict[str, Any]:
    """What a field takes; where it has a unit, every number of it as a string too."""
    unit = unit_of(hint)
    if unit is None:
        return written
    example = WORDS.get(unit, ("", f"1 {unit}"))[1]
    kind = plain(hint)
    several = f"{len(get_args(kind))} numbers" if get_args(kind) and not is_dataclass(kind) else "a number"
    return {**_loosened(written, example), "description": f'{several} in {unit}, or with a unit, such as "{example}"'}


def _loosened(written: Any, example: str) -> Any:
    """A part of a schema in which every number may be a string."""
    if isinstance(written, list):
        return [_loosened(one, example) for one in written]
    if not isinstance(written, dict):
        return written
    if written.get("type") == "number":
        number = {key: value for key, value in written.items() if key not in ("default", "title")}
        rest = {key: value for key, value in written.items() if key in ("default", "title")}
        return {**rest, "anyOf": [number, {"type": "string", "examples": [example]}]}
    return {key: value if key in ("default", "examples") else _loosened(value, example) for key, value in written.items()}
