"""docs/scenes.md and the schema say of every key what the reader of scene files does: no more, no less."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import MISSING, Field, fields
from enum import Enum
from importlib import resources
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from protocol.errors import SceneError
from scenarios.load import built_in, load
from scenarios.quantity import fields_of, unit_of
from scenarios.schema import TABLES, schema

PAGE = (Path(__file__).parents[2] / "docs" / "scenes.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
HEADINGS = {"Scene": "## The scene"}
VALID = jsonschema.Draft202012Validator(schema())
FIRST = tomllib.loads(EXAMPLES[0])


def rows(kind: type) -> dict[str, tuple[str, str]]:
    """Key, unit and default of every row of a table of the page."""
    heading = HEADINGS.get(kind.__name__, f"### {kind.__name__}")
    part = re.split(r"\n##", PAGE.split(f"{heading}\n", 1)[1])[0]
    return {key: (unit.strip(), default.strip()) for key, unit, default in re.findall(r"^\| `(\w+)` \|(.*?)\|(.*?)\|", part, re.MULTILINE)}


def shown(field: Field[Any], kind: type) -> str:
    if field.default is MISSING:
        return "needed"
    if field.default is None:
        return "as the cable" if kind.__name__ == "Section" else "none"
    if field.default == ():
        return "none"
    if isinstance(field.default, Enum):
        return f'"{field.default.value}"'
    if isinstance(field.default, str):
        return f'"{field.default}"'
    if isinstance(field.default, tuple):
        return f"({', '.join(f'{value:g}' for value in field.default)})"
    return f"{field.default:g}"


@pytest.mark.parametrize("kind", TABLES, ids=lambda kind: kind.__name__)
def test_every_key_has_its_row_with_its_unit_and_its_default(kind: type) -> None:
    hints = fields_of(kind)
    wanted = {field.name: (unit_of(hints[field.name]) or "", shown(field, kind)) for field in fields(kind)}
    assert rows(kind) == wanted


@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_every_example_is_a_correct_scene(number: int, tmp_path: Path) -> None:
    file = tmp_path / "my_scene.toml"
    file.write_text(EXAMPLES[number], encoding="utf-8")
    assert load(file).title


@pytest.mark.parametrize("name", built_in())
def test_the_schema_takes_every_built_in_scene(name: str) -> None:
    text = (resources.files("scenarios") / f"{name}.toml").read_text(encoding="utf-8")
    assert [error.message for error in VALID.iter_errors(tomllib.loads(text))] == []


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"tolerence": 1.0}, "tolerence"),
        ({"time_step": True}, "True"),
        ({"time_step": -1.0}, "-1.0"),
        ({"cables": []}, "[]"),
        ({"bodies": [{"name": "a", "shape": "cube"}]}, "cube"),
        ({"moves": [{"name": "a"}]}, "duration"),
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(change: dict[str, Any], word: str, tmp_path: Path) -> None:
    assert VALID.is_valid(FIRST)
    assert any(word in error.message or word in json.dumps(error.instance) for error in VALID.iter_errors(FIRST | change))
    settings = [f"{key}={json.dumps(value)}" for key, value in change.items() if key in ("time_step", "tolerence")]
    if settings:
        file = tmp_path / "scene.toml"
        file.write_text(EXAMPLES[0], encoding="utf-8")
        with pytest.raises(SceneError):
            load(file, settings)


def test_a_number_with_a_unit_may_be_a_string_in_the_schema_and_one_without_may_not() -> None:
    assert VALID.is_valid(FIRST | {"time_step": "50 ms", "gravity": ["0 m/s^2", 0, "-9.81 m/s^2"]})
    assert not VALID.is_valid(FIRST | {"relaxation": {"overshoot": "a tenth"}})
