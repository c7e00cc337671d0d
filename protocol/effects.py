"""Which effects of a cable are simulated: those that matter ("auto"), those of a list, or some forced on or off by a table.

    effects = "auto"                              # each by its predicted size and the tolerance
    effects = ["gravity", "bending", "twist"]     # these and no others
    effects = {stretch = true, preform = false}   # these two as said, the others by their size

An effect is asked for by a number of the cable; the choice only ever leaves out what was asked for. What follows from where the
cable lies (contact, friction, bonds, inclination, self-contact) is no matter of choice. On the wire a choice is a table: empty for "auto".
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Annotated, Final, Literal

from .cable import Cable
from .errors import MessageError
from .part import Part


@dataclass(frozen=True)
class Wanted:
    """What to write at a field that takes several kinds of values, as the end of a sentence; read only by `scenarios`."""

    sentence: str


CHOOSABLE: Final[dict[str, tuple[str, Callable[[Cable], bool]]]] = {
    "gravity": ("'mass_per_length'", lambda cable: _has(cable, "mass_per_length")),
    "masses": ("'masses'", lambda cable: bool(cable.masses)),
    "loads": ("loads, which only a posture has", lambda cable: False),
    "bending": ("'bending' (EI)", lambda cable: cable.bending is not None),
    "twist": ("'twist' (GJ)", lambda cable: cable.twist is not None),
    "preform": ("'natural_curvature'", lambda cable: _has(cable, "natural_curvature")),
    "micro_length": ("'micro_length'", lambda cable: cable.micro_length is not None),
    "bend_radius": ("'bend_radius'", lambda cable: cable.bend_radius is not None),
    "stretch": ("'stretch' (EA)", lambda cable: cable.stretch is not None),
}
"""Effects that may be left out: the number that asks for each, and whether a cable has it."""

GIVEN: Final = ("contact", "friction", "bond", "inclination", "self_contact")
"""Effects that bodies, or the cable itself, call for where it touches them."""

WITH_BENDING: Final = ("twist", "preform", "micro_length", "bend_radius")
"""Effects of a cable that bends: without bending there are none of them."""

AUDIT: Final = "audit"
"""Why an effect is on that an audit has switched on, for it moved more than was said."""

GOING: Final = "going"
"""Why an effect is on that the next shape may leave out: its size has fallen well below what it came on at."""

EffectChoice = Annotated[
    Literal["auto"] | tuple[str, ...] | dict[str, bool],
    Wanted('give "auto", a list of names such as ["gravity", "bending", "twist"], or a table such as {stretch = true, preform = false}'),
]


class Predicted(Part, frozen=True):
    """What an effect of the cable could change in a shape, and whether it is simulated."""

    name: str
    size: float  # m, bound of what it moves any node by, and so of what it takes off any clearance
    force: float  # N, of what it changes a force by
    curvature: float  # 1/m, of what it changes a curvature by
    is_on: bool
    why: str  # "above" or "below" its share, "going" (off next time), "needed", "with bending", "asked", or "audit"


class Audited(Part, frozen=True):
    """What leaving an effect out did change in a step, which was solved with everything on as well."""

    step: int  # that was audited; the frame is that of the step from which the answer counts
    cable: int  # index in the scene
    name: str  # of the effect
    bound: float  # m, what was said that it moves any node by at most
    actual: float | None  # m, what it moves; None where there is no shape with everything on
    is_broken: bool  # whether it moves more than was said
    is_switched_on: bool  # whether it is on from this frame on


def table_of(choice: str | tuple[str, ...] | dict[str, bool]) -> dict[str, bool]:
    """A choice as it travels: what is forced on or off, by name; nothing for "auto"."""
    if isinstance(choice, dict):
        return dict(choice)
    return {} if isinstance(choice, str) else {name: name in choice for name in CHOOSABLE}


def check_effects(forced: dict[str, bool]) -> None:
    """Check the choice of a request.

    Raises:
        MessageError: Names the effect.
    """
    for name, sentence in _mistakes(forced):
        raise MessageError(f"effects.{sentence}", key=f"effects.{name}")


def effects_mistakes(choice: str | tuple[str, ...] | dict[str, bool], cables: Iterable[Cable]) -> Iterator[tuple[str, str]]:
    """What is wrong with the choice of a scene: key and sentence, which begins with the key."""
    is_table = isinstance(choice, dict)
    names = tuple(choice) if not isinstance(choice, str) else ()
    for name in names:
        if names.count(name) > 1:
            yield "effects", f"effects: '{name}' is named {names.count(name)} times; name it once"
        if name not in CHOOSABLE:
            yield "effects", f"effects: {_unknown(name)}"
    forced = {name: on for name, on in table_of(choice).items() if name in CHOOSABLE}
    for name, sentence in _mistakes(forced):
        yield (f"effects.{name}", f"effects.{sentence}") if is_table else ("effects", f"effects: {sentence.partition(': ')[2]}")
    for name in names:
        if name in CHOOSABLE and forced[name] and not any(CHOOSABLE[name][1](cable) for cable in cables):
            yield "effects", f"effects: '{name}' is to be on, and no cable has {CHOOSABLE[name][0]}; give the number, or leave '{name}' out"


def _mistakes(forced: dict[str, bool]) -> Iterator[tuple[str, str]]:
    for name in forced:
        if name not in CHOOSABLE:
            yield name, f"{name}: {_unknown(name)}"
    bends = forced.get("bending")
    if bends is False:
        for name in WITH_BENDING:
            if forced.get(name):
                yield name, f"{name}: '{name}' is to be on without 'bending'; name 'bending' too"
    if bends and forced.get("twist") is False:
        yield "twist", "twist: 'bending' is to be on without 'twist'; a cable that bends also twists, so name 'twist' too"


def _unknown(name: str) -> str:
    if name in GIVEN:
        return f"'{name}' goes with what the cable touches, and is no matter of choice; change the bodies of the scene, or leave it out"
    return f"'{name}' unknown; there are {', '.join(CHOOSABLE)}"


def _has(cable: Cable, name: str) -> bool:
    return bool(getattr(cable, name)) or any(getattr(section, name) is not None for section in cable.sections)
