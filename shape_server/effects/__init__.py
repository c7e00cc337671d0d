"""One file for each effect: what it adds to the system, with its equation and its source.

An effect is asked for by a number in the cable or the request; one that is not asked for is not imported. The system
sums what the effects add without knowing any of them by name:

- `node_loads(cable, loads, gravity, mesh)`: a load on every node [N];
- `stiffness(cable, mesh)`: a diagonal law for curvature and twist of every segment [N m^2];
- `natural(cable, mesh)`: curvature and twist of every segment when free of any load [1/m];
- `give(cable, mesh)`: growth of every segment under a unit of tension [m/N];
- `smoothing(cable, mesh)`: stiffness of every segment against a difference of curvature between its ends [N m^3];
- `limit(cable, mesh)`: largest curvature [1/m], and the stiffness beyond it [N m^2];
- `rows(contacts, chosen, mesh)`: border rows, each with a force as its unknown; of one-sided contacts what `grouped` says of them
  is in the place of `chosen`, of those with friction what `laws` says of them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Final

from protocol.kinds import FRICTION_CODES, Friction
from protocol.messages import Problem
from protocol.scene import Cable, Vector

ASKED_BY: Final[dict[str, Callable[[Problem, Vector], bool]]] = {
    "gravity": lambda problem, gravity: any(gravity) and _has_mass(problem.cable),
    "masses": lambda problem, gravity: any(gravity) and bool(problem.cable.masses),
    "loads": lambda problem, _: problem.loads is not None and len(problem.loads.s) > 0,
    "bending": lambda problem, _: problem.cable.bending is not None,
    "twist": lambda problem, _: problem.cable.twist is not None,
    "preform": lambda problem, _: _has(problem.cable, "natural_curvature"),
    "micro_length": lambda problem, _: problem.cable.micro_length is not None,
    "bend_radius": lambda problem, _: problem.cable.bend_radius is not None,
    "stretch": lambda problem, _: problem.cable.stretch is not None,
    "contact": lambda problem, _: _has_contact(problem, Friction.NONE) or rubs(problem),
    "friction": lambda problem, _: rubs(problem),
    "bond": lambda problem, _: _has_contact(problem, Friction.BOND),
    "inclination": lambda problem, _: _has_inclined_bond(problem),
    "self_contact": lambda problem, _: problem.self_contacts is not None and len(problem.self_contacts.s) > 0,
}
"""Every effect and the question whether a problem asks for it; the key is the name of its file."""


WITH_FRICTION: Final = "for contacts with friction, whose answer depends on the path taken; give them 'none' or 'bond', or use solve()"


def asked_for(problem: Problem, gravity: Vector) -> tuple[str, ...]:
    """Names of the effects that a problem asks for."""
    return tuple(name for name, asked in ASKED_BY.items() if asked(problem, gravity))


@cache
def load(name: str) -> ModuleType:
    """The file of an effect, imported on first use."""
    return import_module(f"{__name__}.{name}")


def _has_contact(problem: Problem, friction: Friction) -> bool:
    return problem.contacts is not None and bool((problem.contacts.friction == FRICTION_CODES.index(friction)).any())


def rubs(problem: Problem) -> bool:
    """Whether a contact has a kind of friction whose force depends on how far it slides."""
    return problem.contacts is not None and problem.contacts.rubbing is not None and len(problem.contacts.rubbing.contact) > 0


def _has_inclined_bond(problem: Problem) -> bool:
    touched = problem.contacts
    if touched is None or touched.inclination is None:
        return False
    return bool(((touched.inclination == 1) & (touched.friction == FRICTION_CODES.index(Friction.BOND))).any())


def _has(cable: Cable, name: str) -> bool:
    return getattr(cable, name) is not None or any(getattr(section, name) is not None for section in cable.sections)


def _has_mass(cable: Cable) -> bool:
    return cable.mass_per_length > 0 or any(section.mass_per_length for section in cable.sections)
