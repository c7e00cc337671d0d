"""Floors of triangles from a nanometre to ten metres, slivers, fans and faults of meshes, against the exact plane.

A cable that sags between two grippers is lifted by a floor. However the floor is cut into triangles, the shape must be that on the plane.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import Friction
from protocol.messages import Shape
from protocol.scene import Body, Target

from ..asking import Asker
from ..polyline import points_at
from .laying import move, plane, rough
from .meeting import DIAMETER, LOWEST, hanging
from .playing import Played, playing
from .shells import HALF, Shell, fan, graded, grid, strips

FAMILY: Final = "triangles"
RISE: Final = 0.05  # m
ASIDE: Final = np.array([7e-4, 3e-4, 0.0])  # m, so that no edge lies under the cable


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for least in (10.0, 1.0, 0.1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9):
        yield Case(f"triangles down to {least:g} m", FAMILY, partial(_on, graded(least), None))
        yield Case(f"triangles down to {least:g} m, beside the cable", FAMILY, partial(_on, _moved(graded(least), ASIDE), None))
    for width in (1.0, 0.1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9):
        yield Case(f"slivers of {width:g} m by 10 m across the cable", FAMILY, partial(_on, strips(width), None), may_decline=width < 1e-8)
        yield Case(
            f"slivers of {width:g} m by 10 m along the cable", FAMILY, partial(_on, _turned(strips(width)), None), may_decline=width < 1e-8
        )
    for count in (3, 30, 300, 3000, 30_000):
        yield Case(f"{count} triangles that meet in one point", FAMILY, partial(_on, fan(count), None), is_slow=count > 3000)
    for name, shell in _faulty().items():
        yield Case(f"floor with {name}", FAMILY, partial(_on, shell, None))
    for least in (1e-2, 1e-9):
        yield Case(f"triangles down to {least:g} m that rub", FAMILY, partial(_on, graded(least), 0.3))


def _moved(shell: Shell, by: np.ndarray) -> Shell:
    return shell[0] + by, shell[1]


def _turned(shell: Shell) -> Shell:
    """By a right angle about z."""
    return shell[0] @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), shell[1]


def _faulty() -> dict[str, Shell]:
    """Floors as they come from careless programs."""
    rng = np.random.default_rng(5)
    lines = np.concatenate([[-HALF], np.linspace(-0.5, 0.5, 21), [HALF]])
    vertices, triangles = grid(lines, lines)
    turned = rng.random(len(triangles)) < 0.5
    mixed = np.where(turned[:, None], triangles[:, ::-1], triangles)
    own = vertices[triangles].reshape(-1, 3)
    soup = np.arange(len(own)).reshape(-1, 3)
    needle = np.vstack([vertices, [[0.0, 0.0, 0.0], [1e-12, 0.0, 0.0], [0.0, 1e-12, 0.0]]])
    count = len(vertices)
    return {
        "sides that face down": (vertices, triangles[:, ::-1]),
        "sides that face up and down at random": (vertices, mixed),
        "every triangle given twice": (vertices, np.vstack([triangles, triangles])),
        "every triangle given twice, both ways round": (vertices, np.vstack([triangles, triangles[:, ::-1]])),
        "triangles that share no vertex, a nanometre apart": (own + 1e-9 * rng.normal(size=own.shape) * [1.0, 1.0, 0.0], soup),
        "heights that differ by a nanometre": (vertices + 1e-9 * rng.normal(size=vertices.shape) * [0.0, 0.0, 1.0], triangles),
        "heights that differ by a tenth of a micrometre": (vertices + 1e-7 * rng.normal(size=vertices.shape) * [0.0, 0.0, 1.0], triangles),
        "a triangle of a picometre": (needle, np.vstack([triangles, [[count, count + 1, count + 2]]])),
        "triangles without area": (vertices, np.vstack([triangles, triangles[:5, [0, 1, 1]], [[0, 1, 2]]])),
    }


def _on(shell: Shell, mu: float | None, asker: Asker) -> Iterable[Check]:
    law = {} if mu is None else rough(Friction.SIGNUM, mu)
    height = LOWEST - 0.5 * DIAMETER - 0.02
    exact = _lifted(asker, plane(height, **law), None)
    same = _lifted(asker, Body("floor", mesh="floor", position=(0.0, 0.0, height), **law), shell)
    there, here = exact.shape, same.shape
    # Friction remembers where a cable was, at places that its mesh and its nodes choose.
    within = 5e-6 if mu is None else 1e-4
    yield Check("place of a node against the plane", _apart(here, there), within)
    push, again = (float(shape.contact_forces[:, 2].sum()) for shape in (there, here))
    yield Check("push of the floor against the plane", abs(again / push - 1), 20 * within, "of it")
    yield Check("nodes more or fewer", abs(len(here.s) - len(there.s)), 0.5, "of them")
    yield from same.checks()


def _lifted(asker: Asker, floor: Body, shell: Shell | None) -> Played:
    way = move(Target(body="floor", by=(0.0, 0.0, RISE)), seconds=0.2)
    with playing(hanging((floor,), way), asker, shells={} if shell is None else {"floor": shell}) as played:
        played.to()
    return played


def _apart(one: Shape, other: Shape) -> float:
    return float(np.linalg.norm(one.nodes - points_at(other, one.s), axis=1).max())
