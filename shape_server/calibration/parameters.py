"""The numbers of a cable that a shape can tell, and the cable with other ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from protocol.errors import CablecosimError
from protocol.messages import Problem
from protocol.scene import Cable, Section

FIRST_MICRO_LENGTH: Final = 0.03  # of the cable's length, to look from for one that is not given


@dataclass(frozen=True)
class Parameter:
    """A number of a cable, under its name in the scene."""

    unit: str
    what: str


PARAMETERS: Final = {
    "bending": Parameter("N m^2", "EI, against bending"),
    "twist": Parameter("N m^2", "GJ, against twist"),
    "mass_per_length": Parameter("kg/m", "mass per length"),
    "micro_length": Parameter("m", "micro-structure length"),
}


def first_guess(cable: Cable, name: str) -> float:
    """The value to start from.

    Raises:
        CablecosimError: If the cable gives none.
    """
    value = getattr(cable, name)
    if value is None and name == "micro_length":
        return FIRST_MICRO_LENGTH * cable.length
    if not value:
        raise CablecosimError(f"cable.{name}: missing; give a first guess, within a factor of a hundred", key=f"cable.{name}")
    return float(value)


def with_values(cable: Cable, names: tuple[str, ...], values: np.ndarray) -> Cable:
    """The cable with other numbers; the second bending stiffness and those of sections keep their ratio to them."""
    new = dict(zip(names, values.tolist(), strict=True))
    ratios = {name: value / getattr(cable, name) for name, value in new.items() if getattr(cable, name)}
    if "bending" in ratios:
        ratios["bending_2"] = ratios["bending"]
    sections = tuple(replace(section, **_scaled(section, ratios)) for section in cable.sections)
    return replace(cable, **_scaled(cable, ratios) | new, sections=sections)


def is_one_scale(problem: Problem, names: tuple[str, ...]) -> bool:
    """Whether all that sets the scale of the forces is among the names, so that the shape tells ratios only."""
    cable = problem.cable
    loads = problem.loads is not None and bool(np.any(problem.loads.force))
    given = {name for name in ("bending", "twist", "mass_per_length") if getattr(cable, name)}
    return given <= set(names) and not loads and not cable.masses and cable.stretch is None


def _scaled(part: Cable | Section, ratios: dict[str, float]) -> dict[str, Any]:
    """The numbers that a cable or a section gives, times their ratios."""
    return {name: getattr(part, name) * ratio for name, ratio in ratios.items() if getattr(part, name, None) is not None}
