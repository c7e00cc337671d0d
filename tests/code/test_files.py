"""Every folder says what it is for, files and functions stay short, and every effect has a file."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from rooms import PROGRAMS, ROOMS, ROOT, files, tree

LINES_MAX = 300  # of a file
FUNCTION_MAX = 60  # lines
STOP_WORDS = ("utils", "helpers", "common", "base", "manager", "misc")


@pytest.mark.parametrize("folder", sorted({str(path.parent) for path in files()}))
def test_every_folder_says_in_one_sentence_what_it_is_for(folder: str) -> None:
    init = ROOT / folder / "__init__.py"
    assert init.is_file()
    said = ast.get_docstring(ast.parse(init.read_text(encoding="utf-8")))
    assert said
    first = said.split("\n\n")[0].replace("\n", " ")
    assert first.endswith(".")
    assert ". " not in first


@pytest.mark.parametrize("path", files(), ids=str)
def test_every_file_begins_with_what_it_is_about(path: Path) -> None:
    assert ast.get_docstring(tree(path))
    assert path.stem not in STOP_WORDS


def test_no_file_is_longer_than_300_lines() -> None:
    long = {str(path): count for path in files() if (count := (ROOT / path).read_text(encoding="utf-8").count("\n")) > LINES_MAX}
    assert long == {}


def test_no_function_is_longer_than_60_lines() -> None:
    long = {}
    for path in files():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.FunctionDef):
                count = (node.end_lineno or node.lineno) - node.lineno + 1
                if count > FUNCTION_MAX:
                    long[f"{path}:{node.name}"] = count
    assert long == {}


def test_nothing_is_put_off_printed_or_swallowed() -> None:
    for path in files():
        text = (ROOT / path).read_text(encoding="utf-8")
        assert not [word for word in ("TODO", "FIXME", "XXX", "HACK", "breakpoint(", "if False") if word in text], path
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ExceptHandler):
                assert node.type is not None, path


def test_every_effect_has_a_file_and_is_asked_for_by_a_number() -> None:
    from shape_server.effects import ASKED_BY

    effects = {path.stem: tree(path) for path in files("shape_server") if path.parent.name == "effects" and path.stem != "__init__"}
    assert set(effects) == set(ASKED_BY) >= {"gravity", "bending", "twist", "contact", "bond"}
    for name, module in effects.items():
        first, _, physics = (ast.get_docstring(module) or "").partition("\n\n")
        assert first.split(":")[0].split(" ")[0].lower() in (name, "one-sided"), name
        assert physics, name


def test_public_names_are_given_once_and_exist() -> None:
    import importlib

    for room in ROOMS:
        module = importlib.import_module(room)
        for node in ast.walk(tree(Path(room) / "__init__.py")):
            if isinstance(node, ast.ImportFrom) and node.level:
                for alias in node.names:
                    assert alias.asname == alias.name, f"{room}: write 'import {alias.name} as {alias.name}'"
                    assert hasattr(module, alias.name)


def test_tests_mirror_the_programs() -> None:
    assert {room for room in ROOMS if not list((ROOT / "tests" / room).glob("test_*.py"))} == set()
    assert set(PROGRAMS) <= {path.name for path in (ROOT / "tests").iterdir()}
