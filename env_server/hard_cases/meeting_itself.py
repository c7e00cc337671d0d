"""A cable that meets itself: wound up, its loop pulled tight, and end-on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import Friction, Hold, SelfInteraction
from protocol.messages import Shape
from protocol.scene import Cable, Gripper, Move, Scene, Target, Vector

from ..asking import Asker
from .laying import plane, rough
from .playing import Played, playing

FAMILY: Final = "with itself"
DIAMETER, CHORD = 0.012, 0.45  # m
QUARTERS: Final[tuple[Vector, ...]] = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
DEEP: Final = 5e-4  # m, of the polygon; the smooth axis that the shape server keeps apart runs inside it


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for quarters in (2, 4, 6, 7, 8):
        yield Case(f"wound up by {quarters} quarters of a turn", FAMILY, partial(_wound, quarters, CHORD), is_slow=True)
    for chord in (0.6, 0.8, 0.95, 0.99, 0.999):
        yield Case(f"loop pulled tight to a chord of {chord:g}", FAMILY, partial(_wound, 8, chord), is_slow=True, may_decline=True)
    for aside in (0.0, 1e-4, 3e-3, 8e-3):
        for hold in (Hold.CLAMP, Hold.HINGE):
            name = f"end that comes down on its own middle, {aside:g} m aside, {hold.value}s on the way"
            yield Case(name, FAMILY, partial(_end_on, aside, 1e-2, hold), may_decline=hold is Hold.CLAMP)
    for friction in (Friction.NONE, Friction.SIGNUM):
        for stiff in (1e-3, 1e-2, 1e-1):
            # The softest one buckles, and where it sticks no shape is found from there.
            may = friction is Friction.SIGNUM and stiff < 1e-2
            name = f"end that meets a floor, {friction.value}, EI {stiff:g}"
            yield Case(name, FAMILY, partial(_on_its_end, friction, stiff), may_decline=may)


def _cable(bending: float = 1e-2, **fields: object) -> Cable:
    given = {"length": 1.0, "mass_per_length": 0.02, "twist": 0.8 * bending, "self_interaction": SelfInteraction.CONTACT, **fields}
    return Cable(name="c", diameter=DIAMETER, bending=bending, **given)  # type: ignore[arg-type]


def wound(quarters: int, chord: float) -> Scene:
    """A cable between two grippers, one of which turns about it by quarters of a turn and then goes away to a chord [m]."""
    grippers = (
        Gripper("left", "c", 0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        Gripper("right", "c", 1.0, (CHORD, 0.0, 0.0), (1.0, 0.0, 0.0)),
    )
    moves = [Move(f"quarter {k}", 1.0, (Target("right", approach=QUARTERS[k % 4]),)) for k in range(quarters)]
    if chord > CHORD:
        moves.append(Move("pull", 5.0, (Target("right", by=(chord - CHORD, 0.0, 0.0)),)))
    return Scene("a wound cable", (_cable(),), grippers, tuple(moves), time_step=0.1, tolerance=5e-3)


def _wound(quarters: int, chord: float, asker: Asker) -> Iterable[Check]:
    with playing(wound(quarters, chord), asker) as played:
        deepest, turned = 0.0, [played.shape.total_twist]
        for shape in played.on():
            deepest = max(deepest, _depth(played))
            turned.append(shape.total_twist)
        yield Check("deepest in itself", deepest, DEEP)
        yield from played.checks(snaps=3)


def _depth(played: Played) -> float:
    own = played.now.cables[0].own
    return 0.0 if own is None else own.candidates.penetration


def _end_on(aside: float, bending: float, hold: Hold, asker: Asker) -> Iterable[Check]:
    """A strand is held at both ends; beyond it the cable goes up and over, and down through a gripper: its end comes down on the strand."""
    grippers = (
        Gripper("left", "c", 0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), approach=(0.0, 1.0, 0.0)),
        Gripper("middle", "c", 0.3, (0.29, 0.0, 0.0), (1.0, 0.0, 0.0), approach=(0.0, 1.0, 0.0), hold=hold),
        Gripper("right", "c", 0.75, (0.14, aside, 0.25), (0.0, 0.0, -1.0), approach=(0.0, 1.0, 0.0), hold=hold),
    )
    down = Move("down", 2.0, (Target("right", by=(0.0, 0.0, -0.2)),))
    held = _cable(bending, length=0.9)
    with playing(Scene("end-on", (held,), grippers, (down,), time_step=0.05, tolerance=5e-3), asker) as played:
        deepest = 0.0
        for _ in played.on():
            deepest = max(deepest, _depth(played))
        own = played.now.cables[0].own
        push = 0.0 if own is None else float(np.linalg.norm(own.reactions.force, axis=1).sum())
        yield Check("deepest in itself", deepest, DEEP)
        yield Check("push that is missing", 1e-3 - push, 1e-6, "N")
        yield from played.checks(snaps=3)


def _on_its_end(friction: Friction, bending: float, asker: Asker) -> Iterable[Check]:
    """A cable that hangs from a gripper, and a floor that comes up under its end by a fifth of its length."""
    gripper = Gripper("g", "c", 0.0, (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), approach=(0.0, 1.0, 0.0), hold=Hold.CLAMP)
    held = _cable(bending, self_interaction=SelfInteraction.TRANSPARENT)
    up = Move("up", 2.0, (Target(body="floor", by=(0.0, 0.0, 0.2)),))
    bodies = (plane(-0.02, **rough(friction, 0.3)),)
    with playing(Scene("on its end", (held,), (gripper,), (up,), bodies, time_step=0.05, tolerance=5e-3), asker) as played:
        shape: Shape = played.to()
        yield Check("cable below the floor", 0.18 + 0.5 * DIAMETER - float(shape.nodes[:, 2].min()), 0.5 * DIAMETER + 1e-6)
        yield from played.checks(snaps=3)
