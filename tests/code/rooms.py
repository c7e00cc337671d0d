"""The source files of the project and what they import, read without importing them."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROGRAMS = ("shape_server", "env_server", "viz_client", "scenarios")
ROOMS = ("protocol", *PROGRAMS)


def files(*rooms: str) -> list[Path]:
    """Source files of some rooms, as paths from the root."""
    return [path.relative_to(ROOT) for room in rooms or ROOMS for path in sorted((ROOT / room).rglob("*.py"))]


@cache
def tree(path: Path) -> ast.Module:
    """A file, parsed."""
    return ast.parse((ROOT / path).read_text(encoding="utf-8"), filename=str(path))


@cache
def imports(path: Path) -> tuple[str, ...]:
    """Full names of the modules that a file imports, at its top or further down, also when written as text for a child."""
    return tuple(_imports(path))


def _imports(path: Path) -> Iterator[str]:
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("import_module", "importlib.import_module", "__import__"):
            names = [argument.value for argument in node.args[:1] if isinstance(argument, ast.Constant)]
            yield from (str(name) for name in names if not str(name).startswith("."))


def importers(library: str, *rooms: str) -> set[str]:
    """Files that import a library."""
    return {str(path) for path in files(*rooms) if any(name.split(".")[0] == library for name in imports(path))}
