"""Bodies that come for a cable, start inside it, squeeze it, hold it by a hundred places, or let it slide off.

A cable of 0.8 m hangs between two grippers; its lowest place is `LOWEST`. Whatever comes must push it along and never pass it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import Friction, Primitive
from protocol.messages import Shape
from protocol.scene import Body, Cable, Scene, Target, Vector

from ..asking import Asker
from .laying import gripper, move, plane, rough, scene
from .playing import playing
from .shells import box

FAMILY: Final = "bodies"
DIAMETER: Final = 0.006  # m
CABLE: Final = Cable("c", 0.8, DIAMETER, 0.05, 2e-3, 2e-3)
HALF: Final = 0.3  # m, of the span
LOWEST: Final = 0.757  # m, about
KINDS: Final = ("sphere", "capsule", "plate", "rod")
PLATE: Final = (0.1, 0.002, 0.06)  # m
SHELLS: Final = {"plate": box(PLATE), "block": box((0.05, 0.2, 0.04))}
PUSHING: Final = ("capsule", "plate", "rod")  # a cable slips off a sphere to one side
FAST: Final = (1.0, 3.0, 10.0, 25.0)  # diameters in a step
STARTS: Final = (1e-9, 1e-6, 1e-4, 1e-3, 3e-3)  # m that a body begins within the cable


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for kind in KINDS:
        for fast in FAST:
            yield Case(f"{kind} that comes by {fast:g} diameters a step", FAMILY, partial(_thrown, kind, fast))
        for depth in STARTS:
            may = kind == "plate" and depth >= 0.5 * DIAMETER  # in which the cable begins on both sides of it
            yield Case(f"{kind} that starts {depth:g} m within the cable", FAMILY, partial(_within, kind, depth), may_decline=may)
        yield Case(f"{kind} that starts across the axis of the cable", FAMILY, partial(_within, kind, 0.5 * DIAMETER), may_decline=True)
        if kind != "rod":
            yield Case(f"{kind} that swallows the cable at the start", FAMILY, partial(_within, kind, 2 * DIAMETER), may_decline=True)
    for kind in ("plane and block", "blocks", "spheres"):
        for gap in (1e-3, 1e-6, 0.0, -1e-4, -1e-3):
            yield Case(f"{kind} that leave {gap:g} m to spare", FAMILY, partial(_squeezed, kind, gap), may_decline=gap < 0.0)
    for size in (1e-9, 1e-7, 1e-5, 1e-3):
        for friction in (Friction.NONE, Friction.SIGNUM):
            yield Case(f"contact that flickers by {size:g} m, {friction.value}", FAMILY, partial(_flickers, size, friction))


def hanging(bodies: tuple[Body, ...], *moves: Any, **fields: Any) -> Scene:
    """The cable with bodies, in the plane x-z."""
    grippers = (
        gripper(0.0, (-HALF, 0.0, 1.0), (1.0, 0.0, -0.5), name="left"),
        gripper(0.8, (HALF, 0.0, 1.0), (1.0, 0.0, 0.5), name="right"),
    )
    return scene(CABLE, grippers, bodies, tuple(moves), **{"tolerance": 5e-4, "time_step": 0.02, **fields})


def _body(kind: str, surface: Vector, towards: int, name: str = "body", **fields: Any) -> Body:
    """A body whose foremost point is at `surface`, and which comes along axis 1 (y) or 2 (z); all are 60 mm long or round."""
    at = np.array(surface)
    if kind == "plate":  # 2 mm thick, with its broad side ahead along y, its edge ahead along z
        at[towards] -= 0.5 * PLATE[towards]
        return Body(name, mesh="plate", position=(at[0], at[1], at[2]), **fields)
    radius = {"sphere": 0.02, "capsule": 0.01, "rod": 1e-4}[kind]
    at[towards] -= radius
    position = (float(at[0]), float(at[1]), float(at[2]))
    if kind == "sphere":
        return Body(name, shape=Primitive.SPHERE, radius=radius, position=position, **fields)
    # Along x if it came from below would be along the cable: the axis lies across it and across its way.
    half = float(np.sqrt(0.5))
    turn = (0.0, 0.0, 0.0, 1.0) if towards == 1 else (half, 0.0, 0.0, half)
    shape = Primitive.CAPSULE
    return Body(name, shape=shape, radius=radius, length=0.1, position=position, quaternion=turn, **fields)


def _foremost(shape: Shape, towards: int) -> float:
    """Where the middle of the cable is along an axis [m]."""
    return float(np.interp(0.4, shape.s, shape.nodes[:, towards]))


def _thrown(kind: str, fast: float, asker: Asker) -> Iterable[Check]:
    """From the side, by 0.15 m, at 15 / 8 of its mean speed in the middle of its way."""
    steps = max(1, round(0.15 / (fast * DIAMETER)))
    body = _body(kind, (0.0, -0.05, LOWEST + 0.003), 1)
    way = move(Target(body="body", by=(0.0, 0.15, 0.0)), seconds=0.02 * steps)
    with playing(hanging((body,), way), asker, shells=SHELLS) as played:
        for shape in played.on():
            face = -0.05 + 0.15 * _share(played.step / steps)
            if kind in PUSHING and face > -0.5 * DIAMETER:
                yield Check("body that has gone past the axis", face - _foremost(shape, 1), 1e-6)
        if kind in PUSHING:
            yield Check("middle of the cable that stayed behind", 0.1 - _foremost(shape, 1), 1e-6)
        yield from played.checks(snaps=1)


def _share(passed: float) -> float:
    return passed**3 * (10.0 - 15.0 * passed + 6.0 * passed**2)


def _within(kind: str, depth: float, asker: Asker) -> Iterable[Check]:
    """A body that begins so deep in the cable from below, and stays; the cable must be off it, above, or the answer a sentence."""
    with playing(hanging(()), asker) as played:
        low = float(played.shape.nodes[:, 2].min()) - 0.5 * DIAMETER
    with playing(hanging((_body(kind, (0.0, 0.0, low + depth), 2),), move(seconds=0.1)), asker, shells=SHELLS) as played:
        played.to()
        if kind in PUSHING:
            yield Check("lift of the cable against the depth", abs(_foremost(played.shape, 2) - low - 0.5 * DIAMETER - depth), 1e-4)
        yield from played.checks(snaps=1)


def _squeezed(kind: str, gap: float, asker: Asker) -> Iterable[Check]:
    """Two bodies that come from both sides along z until so much more than the diameter is between them."""
    with playing(hanging(()), asker) as played:
        level = float(played.shape.nodes[:, 2].min()) + 0.01
    apart = 0.5 * (DIAMETER + gap) + 0.05
    round_ones: dict[str, Any] = {"shape": Primitive.SPHERE, "radius": 0.02}
    shape: dict[str, Any] = round_ones if kind == "spheres" else {"mesh": "block"}
    above = Body("above", position=(0.0, 0.0, level + apart + 0.02), **shape)
    below = (
        plane(level - apart, name="below")
        if kind == "plane and block"
        else replace(above, name="below", position=(0.0, 0.0, level - apart - 0.02))
    )
    way = move(Target(body="below", by=(0.0, 0.0, 0.05)), Target(body="above", by=(0.0, 0.0, -0.05)), seconds=0.4)
    with playing(hanging((below, above), way), asker, shells=SHELLS) as played:
        shape_now = played.to()
        if kind != "spheres":
            yield Check("middle of the cable off the middle", abs(_foremost(shape_now, 2) - level), 0.5 * abs(gap) + 1e-5)
        yield from played.checks(snaps=1)


def _flickers(size: float, friction: Friction, asker: Asker) -> Iterable[Check]:
    """A floor that comes up to where it just touches, and goes up and down there by so much, ten times."""
    with playing(hanging(()), asker) as played:
        free = played.shape
        low = float(free.nodes[:, 2].min()) - 0.5 * DIAMETER
    ways = [move(Target(body="floor", by=(0.0, 0.0, 0.02 + size)), name="up", seconds=0.1)]
    for k in range(10):
        ways += [move(Target(body="floor", by=(0.0, 0.0, sign * 2 * size)), name=f"{k} {sign}", seconds=0.1) for sign in (-1.0, 1.0)]
    floor = plane(low - 0.02, **rough(friction, 0.5))
    with playing(hanging((floor,), *ways), asker) as played:
        shape = played.to()
        yield Check("distance from the free cable", float(np.abs(_at(shape, free) - free.nodes).max()), 1e-6 + 10 * size)
        yield from played.checks()


def _at(shape: Shape, other: Shape) -> np.ndarray:
    return np.column_stack([np.interp(other.s, shape.s, column) for column in shape.nodes.T])
