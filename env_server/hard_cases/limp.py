"""Cables without bending that meet what is wider than their segments: drums, capsules, floors, blocks, smooth and rough.

A chain of 0.8 m hangs between two grippers. What comes from below must lift it, and never pass it; on what is smooth, tension less weight
times height is one number all along the chain, whatever it lies on (Appell 1919, vol. 1, ch. 7), to within what a polygon rounds off.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Any, Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import Friction, Hold, Primitive
from protocol.messages import Shape
from protocol.scene import Body, Cable, Scene, Target

from ..asking import Asker
from ..polyline import points_at
from .laying import gripper, move, plane, rough, scene
from .playing import Played, playing
from .shells import box

FAMILY: Final = "limp cables"
CHAIN: Final = Cable("c", 0.8, 0.006, 0.05)
HALF: Final = 0.3  # m, of the span
LOWEST: Final = 0.76  # m, about
SHELLS: Final = {"block": box((0.05, 0.2, 0.04))}
ROUND: Final = {"capsule": Primitive.CAPSULE, "cylinder": Primitive.CYLINDER}
ACROSS: Final = (0.5**0.5, 0.0, 0.0, 0.5**0.5)


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for name in ROUND:
        for radius in (0.02, 0.05, 0.1):
            for steps in (5, 20):
                yield Case(f"{name} of {radius:g} m that lifts it in {steps} steps", FAMILY, partial(_lifted, name, radius, steps))
    for radius in (0.05, 0.1):
        yield Case(f"drum of {radius:g} m up and down again", FAMILY, partial(_returns, radius))
        for mu in (0.1, 0.5, 1.0):
            yield Case(f"drum of {radius:g} m, mu = {mu:g}", FAMILY, partial(_rubs, radius, mu))
    for height in (0.02, 0.05, 0.1):
        yield Case(f"floor that rises by {height:g} m under it", FAMILY, partial(_floor, height, Friction.NONE))
        yield Case(f"rough floor that rises by {height:g} m under it", FAMILY, partial(_floor, height, Friction.SIGNUM))
    for tolerance in (2e-3, 1e-3):
        yield Case(f"block that lifts it, tolerance of {tolerance:g} m", FAMILY, partial(_block, tolerance), is_slow=True)


def _hanging(bodies: tuple[Body, ...], *moves: Any, **fields: Any) -> Scene:
    grippers = (
        gripper(0.0, (-HALF, 0.0, 1.0), (1.0, 0.0, -0.5), name="left", hold=Hold.HINGE),
        gripper(0.8, (HALF, 0.0, 1.0), (1.0, 0.0, 0.5), name="right", hold=Hold.HINGE),
    )
    return scene(CHAIN, grippers, bodies, tuple(moves), **{"tolerance": 1e-3, "time_step": 0.05, **fields})


def _drum(name: str, radius: float, **fields: Any) -> Body:
    """Just below the chain, its axis across."""
    below = (0.0, 0.0, LOWEST - radius - 0.01)
    return Body("body", shape=ROUND[name], radius=radius, length=0.3, position=below, quaternion=ACROSS, **fields)


def _kinetic(played: Played) -> Check:
    """Spread of tension less weight times height."""
    shape, weight = played.shape, CHAIN.mass_per_length * 9.81
    middle = 0.5 * (shape.nodes[1:, 2] + shape.nodes[:-1, 2])
    return Check("spread of T - w z", float(np.ptp(shape.tension - weight * middle)) / float(shape.tension.max()), 0.05, "of T")


def _top(shape: Shape) -> float:
    """Height of the axis above the middle of what lifts it [m]."""
    return float(np.interp(0.0, shape.nodes[:, 0], shape.nodes[:, 2]))


def _lifted(name: str, radius: float, steps: int, asker: Asker) -> Iterable[Check]:
    way = move(Target(body="body", by=(0.0, 0.0, 0.1)), seconds=0.05 * steps)
    with playing(_hanging((_drum(name, radius),), way), asker) as played:
        played.to()
        yield Check("gap at the top", abs(_top(played.shape) - (LOWEST + 0.09) - 0.003), 1e-3)
        yield _kinetic(played)
        yield from played.checks()


def _returns(radius: float, asker: Asker) -> Iterable[Check]:
    """Without friction what a body does to a chain it takes back."""
    there = [move(Target(body="body", by=(0.0, 0.0, z)), name=name) for name, z in (("up", 0.08), ("down", -0.08))]
    with playing(_hanging((_drum("cylinder", radius),), *there), asker) as played:
        first = played.shape
        last = played.to()
        at = np.column_stack([np.interp(first.s, last.s, column) for column in last.nodes.T])
        yield Check("way from where it was", float(np.linalg.norm(at - first.nodes, axis=1).max()), 2e-3)
        yield from played.checks()


def _rubs(radius: float, mu: float, asker: Asker) -> Iterable[Check]:
    """One end is pulled down over a drum that has lifted the chain: it slides, or comes up again with it."""
    legs = (
        move(Target(body="body", by=(0.0, 0.0, 0.08)), name="up"),
        move(Target(gripper="right", by=(0.0, 0.0, -0.08)), name="pull"),
    )
    with playing(_hanging((_drum("cylinder", radius, **rough(Friction.SIGNUM, mu)),), *legs), asker) as played:
        for shape in played.on():
            away = points_at(shape, shape.contact_s) - played.now.posture.surfaces[0, :3]
            away[:, 1] = 0.0
            away /= np.linalg.norm(away, axis=1)[:, None]
            push = np.einsum("ij,ij->i", shape.contact_forces, away)
            drag = np.linalg.norm(shape.contact_forces - push[:, None] * away, axis=1)
            yield Check("friction beyond its limit", float((drag - mu * push).max(initial=0.0)), 1e-3 * CHAIN.mass_per_length * 9.81, "N")
        yield from played.checks(snaps=1)


def _floor(height: float, kind: Friction, asker: Asker) -> Iterable[Check]:
    way = move(Target(body="floor", by=(0.0, 0.0, height)))
    with playing(_hanging((plane(LOWEST - 0.01, **(rough(kind, 0.4) if kind is Friction.SIGNUM else {})),), way), asker) as played:
        shape = played.to()
        yield Check("gap on the floor", abs(float(shape.nodes[:, 2].min()) - (LOWEST - 0.01 + height) - 0.003), 1e-5)
        if kind is Friction.NONE:
            yield _kinetic(played)
        yield from played.checks(snaps=1)


def _block(tolerance: float, asker: Asker) -> Iterable[Check]:
    """It lies on a face and hangs over two edges; a polygon cuts a sharp bend off, by less than the tolerance."""
    block = Body("body", mesh="block", position=(0.0, 0.0, LOWEST - 0.05))
    with playing(_hanging((block,), move(Target(body="body", by=(0.0, 0.0, 0.1))), tolerance=tolerance), asker, shells=SHELLS) as played:
        played.to()
        yield _kinetic(played)
        yield from played.checks(snaps=1, deepest=tolerance)
