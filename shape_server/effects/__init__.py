"""One file for each effect: what it adds to the system, with its equation and its source.

An effect is asked for by a number in the cable or the request; one that is not asked for is not imported. The system
sums what the effects add without knowing any of them by name:

- `node_loads(lengths, cable, gravity)`: a load on every node [N];
- `stiffness(cable)`: a diagonal law for curvature and twist at the nodes [N m^2];
- `rows(contacts, mesh)`: border rows, each with a force as its unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Final

from protocol.kinds import FRICTION_CODES, Friction
from protocol.messages import Problem
from protocol.scene import Vector

ASKED_BY: Final[dict[str, Callable[[Problem, Vector], bool]]] = {
    "gravity": lambda problem, gravity: problem.cable.mass_per_length > 0 and any(gravity),
    "bending": lambda problem, _: problem.cable.bending is not None,
    "twist": lambda problem, _: problem.cable.twist is not None,
    "contact": lambda problem, _: _has_contact(problem, Friction.NONE),
    "bond": lambda problem, _: _has_contact(problem, Friction.BOND),
}
"""Every effect and the question whether a problem asks for it; the key is the name of its file."""


def asked_for(problem: Problem, gravity: Vector) -> tuple[str, ...]:
    """Names of the effects that a problem asks for."""
    return tuple(name for name, asked in ASKED_BY.items() if asked(problem, gravity))


def load(name: str) -> ModuleType:
    """The file of an effect, imported on first use."""
    return import_module(f"{__name__}.{name}")


def _has_contact(problem: Problem, friction: Friction) -> bool:
    return problem.contacts is not None and bool((problem.contacts.friction == FRICTION_CODES.index(friction)).any())
