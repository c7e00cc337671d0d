"""Grippers on their way while the cable lies on something: a jump or many steps, a nanometre a step, shaking, there and back, finer nodes.

Without friction the way must not matter, unless the cable has snapped; with friction it may, by no more than the way that it rubbed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import Friction, Primitive
from protocol.messages import Shape
from protocol.scene import Body, Move, Target, Vector

from ..asking import Asker
from ..polyline import points_at
from .laying import move, plane, rough
from .meeting import DIAMETER, LOWEST, SHELLS, hanging
from .playing import Played, playing
from .rubbing import coulomb

FAMILY: Final = "journeys"
GROUNDS: Final = ("floor", "ball", "block")
WAYS: Final[dict[str, Vector]] = {"nearer": (-0.1, 0.0, 0.0), "lowered": (0.0, 0.0, -0.08), "aside": (0.0, 0.08, 0.0)}


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for ground in GROUNDS:
        for name in WAYS:
            yield Case(f"{ground}, {name}: a hundred steps against one jump", FAMILY, partial(_jumped, ground, name, 100))
            yield Case(f"{ground}, {name}: a thousand steps against one jump", FAMILY, partial(_jumped, ground, name, 1000), is_slow=True)
            # On its way aside the cable falls off the ball.
            may = ground == "ball" and name == "aside"
            yield Case(f"{ground}, {name}: there and back", FAMILY, partial(_back, ground, name), may_decline=may)
            yield Case(f"{ground}, {name}: a quarter of the tolerance", FAMILY, partial(_finer, ground, name), may_decline=may)
        for friction in (Friction.NONE, Friction.SIGNUM):
            yield Case(f"{ground}, {friction.value}: fifty steps of a nanometre", FAMILY, partial(_nanometres, ground, friction))
            for size in (1e-9, 1e-6, 1e-3, 1e-2):
                # Shaken that far, a cable that sticks to the block comes over its edges.
                may = ground == "block" and friction is Friction.SIGNUM and size == 1e-2
                name = f"{ground}, {friction.value}: gripper that shakes by {size:g} m"
                yield Case(name, FAMILY, partial(_shaken, ground, friction, size), may_decline=may)
        for kind in (Friction.SIGNUM, Friction.REGULARIZED, Friction.DEFINED):
            may = ground == "block"
            yield Case(f"{ground}, {kind.value}: there and back three times", FAMILY, partial(_rubbed, ground, kind), may_decline=may)


def ground_of(name: str, friction: Friction = Friction.NONE) -> Body:
    """What the cable lies on from the first shape on."""
    law = rough(friction, 0.3)
    top = LOWEST + 0.02
    if name == "floor":
        return plane(top, **law)
    if name == "ball":
        return Body("ball", shape=Primitive.SPHERE, radius=0.05, position=(0.02, 0.0, top - 0.05), **law)
    return Body("block", mesh="block", position=(0.02, 0.0, LOWEST - 0.5 * DIAMETER - 0.022), **law)  # just below the cable, at first


def _along(by: Vector, steps: int, *, name: str = "way", step: float = 0.02) -> Move:
    return move(Target("right", by=by), seconds=steps * step, name=name)


def _played(asker: Asker, ground: Body, moves: Iterable[Move], **fields: float) -> Played:
    with playing(hanging((ground,), *moves, **fields), asker, shells=SHELLS) as played:
        for _ in played.on():
            pass
    return played


def _apart(one: Shape, other: Shape) -> float:
    return float(np.linalg.norm(one.nodes - points_at(other, one.s), axis=1).max())


def _may_differ(one: Shape, other: Shape) -> float:
    """How far two shapes at the same place may be apart [m]: on different nodes by what both answers say of their errors."""
    return 1e-4 if len(one.s) == len(other.s) else 1e-4 + (one.error or 0.0) + (other.error or 0.0)


def _jumped(ground: str, name: str, steps: int, asker: Asker) -> Iterable[Check]:
    walked, jumped = (_played(asker, ground_of(ground), [_along(WAYS[name], count)]) for count in (steps, 1))
    yield Check("place of a node, walked and jumped", _apart(walked.shape, jumped.shape), 1e-3)
    yield from walked.checks()
    yield from jumped.checks()


def _back(ground: str, name: str, asker: Asker) -> Iterable[Check]:
    by = WAYS[name]
    with playing(hanging((ground_of(ground),), _along(by, 20), _along(_times(-1.0, by), 20, name="back")), asker, shells=SHELLS) as played:
        first = played.shape
        yield Check("place of a node after the way back", _apart(played.to(), first), _may_differ(played.shape, first))
        yield from played.checks()


def _finer(ground: str, name: str, asker: Asker) -> Iterable[Check]:
    """On a quarter of the tolerance the shape differs by no more than both answers say."""
    coarse, fine = (_played(asker, ground_of(ground), [_along(WAYS[name], 20)], tolerance=tolerance) for tolerance in (1e-3, 2.5e-4))
    yield Check("place of a node, coarse and fine", _apart(coarse.shape, fine.shape), 1.25e-3)
    told = (coarse.shape.error or 0.0) + (fine.shape.error or 0.0)
    yield Check("the same, against what both say", _apart(coarse.shape, fine.shape), 1.5 * told + 1e-6)
    yield from fine.checks()


def _nanometres(ground: str, friction: Friction, asker: Asker) -> Iterable[Check]:
    """Fifty steps that are a nanometre each, in the middle of the way at least."""
    ways = [_along((1e-9, 0.0, 0.0), 1, name=str(k)) for k in range(50)]
    with playing(hanging((ground_of(ground, friction),), *ways), asker, shells=SHELLS) as played:
        played.to(1)
        first = last = played.shape
        for shape in played.on():
            yield Check("move of a node in a step", _apart(shape, last), 1e-6)
            last = shape
        yield Check("all moves together", _apart(played.shape, first), 2e-6)
        yield from played.checks()


def _shaken(ground: str, friction: Friction, size: float, asker: Asker) -> Iterable[Check]:
    """Twenty random places about one, and back at it."""
    rng = np.random.default_rng(7)
    at, ways = np.zeros(3), []
    for k in range(21):
        goal = size * rng.normal(size=3) if k < 20 else np.zeros(3)
        ways.append(_along(_vector(goal - at), 4, name=str(k)))
        at = goal
    with playing(hanging((ground_of(ground, friction),), *ways), asker, shells=SHELLS) as played:
        first = played.shape
        played.to()
        rubbed = 0.0 if friction is Friction.NONE else 40 * size
        yield Check("place of a node after the shaking", _apart(played.shape, first), _may_differ(played.shape, first) + rubbed)
        yield from played.checks()
        yield from coulomb(played, 0.3 if friction is Friction.SIGNUM else 0.0)


def _rubbed(ground: str, kind: Friction, asker: Asker) -> Iterable[Check]:
    """The first way out is another than the later ones; these are alike, but that the regularized law lets what lies still creep on."""
    by = (-0.02, 0.0, 0.0)
    ways = [_along(_times(sign, by), 20, name=f"{k} {sign}") for k in range(3) for sign in (1.0, -1.0)]
    with playing(hanging((ground_of(ground, kind),), *ways), asker, shells=SHELLS) as played:
        ends = [played.to(40) for _ in range(3)]
        yield Check("place of a node after the second and the third time", _apart(ends[2], ends[1]), 2e-3)
        yield from played.checks()
        yield from coulomb(played, 0.3)


def _times(factor: float, by: Vector) -> Vector:
    return (factor * by[0], factor * by[1], factor * by[2])


def _vector(values: np.ndarray) -> Vector:
    return (float(values[0]), float(values[1]), float(values[2]))
