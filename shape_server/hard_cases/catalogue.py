"""All hard cases, family by family."""

from __future__ import annotations

from types import ModuleType

from protocol.hard_case import Case

from . import arches, columns, floors, moving, outside, rough_floors, starts, stiffness, symmetry, taut_and_slack, touching, twisting

FAMILIES = (taut_and_slack, stiffness, columns, twisting, arches, starts, touching, floors, rough_floors, moving, symmetry, outside)


def catalogue(family: str | None = None) -> tuple[Case, ...]:
    """The cases of all families, or of one."""
    return tuple(case for module in FAMILIES if family in (None, module.FAMILY) for case in module.cases())


def family_names() -> tuple[str, ...]:
    """The families in their order."""
    return tuple(module.FAMILY for module in FAMILIES)


def warm_up(path: ModuleType) -> None:
    """Compile what only some models need, so that no case is timed with the compiler."""
    next(case for case in outside.cases() if case.name.startswith("gradient for")).run(path)
