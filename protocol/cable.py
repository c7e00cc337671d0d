"""A cable by its numbers: what it weighs, how stiff it is, what it is made of along its length. SI units.

The same frozen dataclasses serve the scene file, its validation and the wire. Bounds and units stand at the fields as
`Annotated` metadata; what involves several fields is said by `cable_mistakes`, whose sentences begin with the key.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final

from annotated_types import Ge, Gt, Le, MinLen

from .friction import COEFFICIENT_MAX
from .kinds import Hold, SelfInteraction

Vector = tuple[float, float, float]

STRICT: Final = {"extra": "forbid"}
"""Tells pydantic to refuse unknown keys; read only by `scenarios.load`."""


@dataclass(frozen=True)
class Unit:
    """Unit of a number at a field, so that a scene file may say "9 mm" where 0.009 is meant."""

    name: str


LENGTH_MAX: Final = 1e4  # m; what is beyond these bounds is a mistake of unit, not a cable
MASS_MAX: Final = 1e4  # kg/m
STIFFNESS_MAX: Final = 1e9  # N m^2
FORCE_MAX: Final = 1e12  # N
CURVATURE_MAX: Final = 1e5  # 1/m
SECTIONS_MAX: Final = 1_000  # sections, and lumped masses, of one cable
Positive = Annotated[float, Gt(0)]


@dataclass(frozen=True)
class Section:
    """A part of a cable with numbers of its own: taped, sleeved, bent beforehand. What is not given is as in the rest of the cable."""

    __pydantic_config__: ClassVar = STRICT
    start: Annotated[float, Ge(0), Unit("m")]  # arc length
    end: Annotated[Positive, Le(LENGTH_MAX), Unit("m")]  # arc length
    mass_per_length: Annotated[float, Ge(0), Le(MASS_MAX), Unit("kg/m")] | None = None
    stretch: Annotated[Positive, Le(FORCE_MAX), Unit("N")] | None = None
    bending: Annotated[Positive, Le(STIFFNESS_MAX), Unit("N m^2")] | None = None
    bending_2: Annotated[Positive, Le(STIFFNESS_MAX), Unit("N m^2")] | None = None
    twist: Annotated[Positive, Le(STIFFNESS_MAX), Unit("N m^2")] | None = None
    natural_curvature: Annotated[Vector, Unit("1/m")] | None = None


@dataclass(frozen=True)
class LumpedMass:
    """A part that hangs on the cable at one point: a connector, a clip, a grommet."""

    __pydantic_config__: ClassVar = STRICT
    at: Annotated[float, Ge(0), Unit("m")]  # arc length
    mass: Annotated[Positive, Le(MASS_MAX), Unit("kg")]


@dataclass(frozen=True)
class Cable:
    """A cable, by its numbers; a number asks for an effect, and one that is not given leaves the effect out."""

    __pydantic_config__: ClassVar = STRICT
    name: Annotated[str, MinLen(1)]
    length: Annotated[Positive, Le(LENGTH_MAX), Unit("m")]
    diameter: Annotated[Positive, Le(LENGTH_MAX), Unit("m")]
    mass_per_length: Annotated[float, Ge(0), Le(MASS_MAX), Unit("kg/m")]
    bending: Annotated[Positive, Le(STIFFNESS_MAX), Unit("N m^2")] | None = None  # EI; without it the cable is a catenary
    twist: Annotated[Positive, Le(STIFFNESS_MAX), Unit("N m^2")] | None = None  # GJ; goes with bending
    bending_2: Annotated[Positive, Le(STIFFNESS_MAX), Unit("N m^2")] | None = None  # EI about d2, if not as about d1
    stretch: Annotated[Positive, Le(FORCE_MAX), Unit("N")] | None = None  # EA; without it the length is kept exactly
    natural_curvature: Annotated[Vector, Unit("1/m")] | None = None  # about d1 and d2, and twist about d3, free of any load
    micro_length: Annotated[Positive, Le(LENGTH_MAX), Unit("m")] | None = None  # of the gradient of curvature
    bend_radius: Annotated[Positive, Le(LENGTH_MAX), Unit("m")] | None = None  # least radius to which the axis bends
    self_interaction: SelfInteraction = SelfInteraction.TRANSPARENT
    friction_coefficient: Annotated[float, Ge(0), Le(COEFFICIENT_MAX)] | None = None  # mu of its strands, and of it on other cables
    sections: tuple[Section, ...] = ()
    masses: tuple[LumpedMass, ...] = ()


def reaches_any_distance(cable: Cable, holds: Iterable[Hold]) -> bool:
    """Whether held points of a cable may be further apart than it is long: it stretches, or slides in a guide."""
    return cable.stretch is not None or Hold.GUIDE in holds


def cable_mistakes(cable: Cable) -> Iterator[tuple[str, str]]:
    """What does not go together in the numbers of a cable: key and sentence, which begins with the key."""
    for name in ("sections", "masses"):
        count = len(getattr(cable, name))
        if count > SECTIONS_MAX:
            yield name, f"{name}: {count} entries are too many; at most {SECTIONS_MAX}"
    if (cable.bending is None) != (cable.twist is None):
        missing = "twist" if cable.twist is None else "bending"
        yield missing, f"{missing}: missing; a cable has both 'bending' (EI) and 'twist' (GJ), or neither (a catenary)"
    for name in ("bending_2", "natural_curvature", "micro_length", "bend_radius"):
        if getattr(cable, name) is not None and cable.bending is None:
            yield name, f"{name}: given for a cable without 'bending'; give the cable 'bending' and 'twist' too"
    kind = cable.self_interaction
    if kind is not SelfInteraction.TRANSPARENT and cable.bending is None:
        yield "self_interaction", f"self_interaction: '{kind.value}' needs a cable with 'bending' and 'twist'; give it both"
    if kind in (SelfInteraction.CONTACT, SelfInteraction.BOND) and cable.stretch is not None:
        yield "self_interaction", f"self_interaction: '{kind.value}' of a cable that stretches is not built; leave out 'stretch'"
    if cable.friction_coefficient is not None and kind is not SelfInteraction.CONTACT:
        what = "of a cable against itself and other cables, which goes with self_interaction 'contact'"
        yield "friction_coefficient", f"friction_coefficient: given with self_interaction '{kind.value}'; it is that {what}"
    if kind is SelfInteraction.FICTITIOUS and cable.bend_radius is None:
        yield "self_interaction", "self_interaction: 'fictitious' needs 'bend_radius', the least radius to which the cable bends; give it"
    if cable.natural_curvature is not None and not all(abs(value) < CURVATURE_MAX for value in cable.natural_curvature):
        yield "natural_curvature", f"natural_curvature: {list(cable.natural_curvature)} 1/m must be finite, each below {CURVATURE_MAX:g}"
    for index, mass in enumerate(cable.masses):
        if not 0 <= mass.at <= cable.length:
            key = f"masses[{index}].at"
            yield key, f"{key}: {mass.at:g} m lies beyond the end of the cable; give 0 to {cable.length:g} m"
    reached = 0.0
    for index, section in enumerate(cable.sections):
        key = f"sections[{index}]"
        if not reached <= section.start < section.end <= cable.length * (1 + 1e-12):
            yield (
                key,
                (
                    f"{key}: from {section.start:g} to {section.end:g} m must begin after the one before it, at {reached:g} m or later, "
                    f"and end within the cable's {cable.length:g} m"
                ),
            )
        for name in ("bending", "bending_2", "twist", "stretch", "natural_curvature"):
            needs = "bending" if name in ("bending_2", "natural_curvature") else name
            if getattr(section, name) is not None and getattr(cable, needs) is None:
                yield f"{key}.{name}", f"{key}.{name}: given for a part of a cable without '{needs}'; give the cable '{needs}' too"
        reached = section.end
