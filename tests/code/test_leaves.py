"""What is compiled without counting references makes no array, returns none, and calls nothing that might: numba sees the first alone."""

from __future__ import annotations

import ast

import pytest
from rooms import files, tree

NUMBERS = {"int", "float", "bool", "None", "Triple", "Region"}  # and tuples of these; a region is one
BUILTIN = {"abs", "bool", "enumerate", "float", "int", "len", "max", "min", "range", "zip"}


def compiled(kind: str) -> dict[str, ast.FunctionDef]:
    """The functions of `env_server` with a decorator, by name."""
    return {
        node.name: node
        for path in files()
        if path.parts[0] == "env_server"
        for node in tree(path).body
        if isinstance(node, ast.FunctionDef) and any(isinstance(one, ast.Name) and one.id == kind for one in node.decorator_list)
    }


LEAVES = compiled("leaf") | compiled("inlined")


def test_there_are_leaves_and_others() -> None:
    assert len(LEAVES) > 30
    assert "find" in compiled("kernel")


@pytest.mark.parametrize("name", sorted(LEAVES))
def test_a_leaf_returns_numbers(name: str) -> None:
    returned = LEAVES[name].returns
    assert returned is not None
    assert {node.id for node in ast.walk(returned) if isinstance(node, ast.Name)} - {"tuple"} <= NUMBERS


@pytest.mark.parametrize("name", sorted(LEAVES))
def test_a_leaf_calls_leaves_alone(name: str) -> None:
    called = {node.func.id for node in ast.walk(LEAVES[name]) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    records = {"Piece", "Region", "Rim", "Tree"}  # named tuples that nobody keeps
    assert called - BUILTIN - records <= set(LEAVES)
