"""Cables with friction laid across each other and drawn: once, back and forth, off the end, up again, soft and stiff, smooth and rough.

The lower one reaches out from a gripper, the upper one, held at one end or at both, is brought down on its far part and drawn along itself.
Neither passes the other; friction is no more than mu times the push, and that much against the way once it slides; all forces on
either cable sum to nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import SelfInteraction
from protocol.scene import Cable, Gripper, Move, Scene, Target

from ..asking import Asker
from .playing import Played, playing

FAMILY: Final = "cables on each other"
DIAMETER: Final = 0.01  # m
OUT: Final = 0.3  # m from the lower gripper to where they cross
DOWN: Final = 0.03  # m, by which the upper one presses the lower one down
LOWER: Final = Cable("lower", 0.5, DIAMETER, 5e-4, 1e-2, 8e-3, self_interaction=SelfInteraction.CONTACT)
STIFFER: Final = (1.0, 30.0, 1e5)  # how much stiffer the upper one is
FRICTION: Final = (0.0, 0.1, 0.3, 1.0)
THROUGH: Final = 1e-6  # m


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for mu in FRICTION:
        for stiffer in STIFFER:
            yield Case(f"drawn over, mu = {mu:g}, {stiffer:g} times as stiff", FAMILY, partial(_drawn, mu, stiffer, 10), is_slow=mu > 0.0)
    for steps in (2, 40):
        yield Case(f"drawn over in {steps} steps", FAMILY, partial(_drawn, 0.3, 1e5, steps), is_slow=True)
    for mu in (0.1, 0.3):
        yield Case(f"drawn back and forth, mu = {mu:g}", FAMILY, partial(_back_and_forth, mu), is_slow=True)
    for mu in (0.0, 0.3):
        yield Case(f"laid down and lifted, mu = {mu:g}", FAMILY, partial(_lifted, mu), is_slow=mu > 0.0)
    for mu in (0.1, 0.5):
        yield Case(f"drawn off the end of the lower one, mu = {mu:g}", FAMILY, partial(_off_the_end, mu), may_decline=True, is_slow=True)


def _scene(mu: float, stiffer: float, *ways: tuple[tuple[float, float, float], int]) -> Scene:
    """Down in ten steps, then the upper one's gripper goes these ways [m] in so many steps each."""
    lower = replace(LOWER, friction_coefficient=mu) if mu else LOWER
    upper = replace(lower, name="upper", length=0.4, bending=1e-2 * stiffer, twist=8e-3 * stiffer)
    grippers = (
        Gripper("root", "lower", 0.0, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        Gripper("hand", "upper", 0.0, (-0.2, OUT, DIAMETER + 0.002), (1.0, 0.0, 0.0)),
    )
    moves = [Move("down", 0.5, (Target("hand", by=(0.0, 0.0, -DOWN - 0.002)),))]
    moves += [Move(f"way {number}", 0.05 * steps, (Target("hand", by=way),)) for number, (way, steps) in enumerate(ways)]
    return Scene("a hard case", (lower, upper), grippers, tuple(moves), time_step=0.05, tolerance=5e-4, gravity=(0.0, 0.0, -9.81))


def _friction(played: Played) -> tuple[np.ndarray, float]:
    """On the lower cable (3,) [N], and the push [N]; zeros where they do not touch."""
    crossed = played.now.crossed
    if crossed is None or not len(crossed.pushes.force):
        return np.zeros(3), 0.0
    drag = sum((point.force for point in crossed.held.points), np.zeros(3))
    return drag, float(np.linalg.norm(crossed.pushes.force.sum(axis=0) - drag))


def _step_checks(played: Played, mu: float) -> Iterable[Check]:
    """What must hold of every step."""
    crossed = played.now.crossed
    push = np.zeros(3) if crossed is None else crossed.pushes.force.sum(axis=0)
    for hanging, sign in zip(played.now.cables, (1.0, -1.0), strict=True):
        shape = hanging.shape
        weight = LOWER.mass_per_length * float(shape.s[-1]) * np.array(played.stage.scene.gravity)
        total = shape.grasp_wrenches[:, :3].sum(axis=0) + weight + sign * push
        yield Check("sum of the forces on a cable", float(np.linalg.norm(total)), 1e-9, "N")
    for near in () if crossed is None else crossed.near:
        yield Check("one in the other", near.penetration, THROUGH)
    drag, pressed = _friction(played)
    yield Check("friction beyond its limit", float(np.linalg.norm(drag)) - mu * pressed, 1e-9, "N")


def _drawn(mu: float, stiffer: float, steps: int, asker: Asker) -> Iterable[Check]:
    with playing(_scene(mu, stiffer, ((0.06, 0.0, 0.0), steps)), asker) as played:
        for _ in played.on():
            yield from _step_checks(played, mu)
        yield from _slides(played, mu, 1.0)


def _slides(played: Played, mu: float, way: float) -> Iterable[Check]:
    drag, pressed = _friction(played)
    yield Check("push that is missing", float(pressed <= 1e-3), 0.5, "of it")
    yield Check("friction short of its limit, along the way", abs(way * float(drag[0]) - mu * pressed), 0.05 * pressed + 1e-9, "N")


def _back_and_forth(mu: float, asker: Asker) -> Iterable[Check]:
    """Each way is far enough to slide, and friction then has the direction of the way."""
    there, back = (0.06, 0.0, 0.0), (-0.06, 0.0, 0.0)
    with playing(_scene(mu, 1e5, (there, 10), (back, 10), (there, 10)), asker) as played:
        played.to(10)
        for way in (1.0, -1.0, 1.0):
            for _ in played.on(10):
                yield from _step_checks(played, mu)
            yield from _slides(played, mu, way)


def _lifted(mu: float, asker: Asker) -> Iterable[Check]:
    """Let go of, the lower one hangs as if it had never been touched."""
    with playing(_scene(mu, 30.0, ((0.02, 0.0, 0.0), 5), ((0.0, 0.0, 0.12), 10)), asker) as played:
        free = played.shape
        for _ in played.on():
            yield from _step_checks(played, mu)
        last = played.shape
        at = np.column_stack([np.interp(free.s, last.s, column) for column in last.nodes.T])
        yield Check("lower one away from where it hung", float(np.linalg.norm(at - free.nodes, axis=1).max()), 1e-4)
        yield Check("force that is left", _friction(played)[1], 1e-12, "N")


def _off_the_end(mu: float, asker: Asker) -> Iterable[Check]:
    """Along the lower one, past its end: they part there, and the lower one comes up."""
    with playing(_scene(mu, 1e5, ((0.0, 0.3, 0.0), 30)), asker) as played:
        for _ in played.on():
            yield from _step_checks(played, mu)
        yield Check("force that is left", _friction(played)[1], 1e-12, "N")
