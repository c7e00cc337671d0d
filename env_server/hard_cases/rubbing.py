"""Friction at its limits: coefficients from 0 to 10, slopes and cylinders just below and above it, contacts that flicker.

References: T(s) = mu w s along a cable that is dragged (Coulomb 1785), times v / sqrt(v^2 + v0^2) for the regularized law; a slope holds a
cable while tan(slope) < mu, and T(s) = w s (sin - mu cos) beyond; T2 / T1 = exp(mu theta) over a cylinder (Euler 1769).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import Friction, Hold
from protocol.scene import Target

from ..asking import Asker
from .laying import RADIUS, WEIGHT, cable, gripper, move, plane, rough, scene, straight
from .playing import Played, playing

FAMILY: Final = "friction"
COEFFICIENTS: Final = (0.0, 1e-6, 1e-3, 0.1, 0.3, 1.0, 3.0, 10.0)
SPEED: Final = 0.01  # m/s, of the regularized law
KINDS: Final = (Friction.SIGNUM, Friction.REGULARIZED, Friction.DEFINED)


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for kind in KINDS:
        for mu in COEFFICIENTS:
            yield Case(f"dragged over a floor, {kind.value}, mu {mu:g}", FAMILY, partial(_dragged, kind, mu))
    for share in (0.5, 0.9, 0.99, 0.999, 1.001, 1.01, 1.1, 2.0):
        yield Case(f"on a slope, at {share:g} of the limit", FAMILY, partial(_sloped, share))


def coulomb(played: Played, mu: float, *, within: float = 1e-6) -> Iterator[Check]:
    """No pull, and no force along the surface above mu N, wherever it touches; on round bodies `within` what chords make of them."""
    pushes = played.now.cables[0].boundary.pushes
    normal = np.einsum("ij,ij->i", pushes.force, pushes.normal)
    along = np.linalg.norm(pushes.force - normal[:, None] * pushes.normal, axis=1)
    scale = max(float(np.abs(normal).sum()), 1e-9)
    yield Check("pull of a body", float(-normal.min(initial=0.0)) / scale, 1e-9, "of all pushes")
    yield Check("friction above mu N", float((along - mu * normal).max(initial=0.0)) / scale, within, "of all pushes")


def _dragged(kind: Friction, mu: float, asker: Asker) -> Iterable[Check]:
    floor = plane(**rough(kind, mu))
    held = gripper(1.0, (1.0, 0.0, RADIUS), hold=Hold.HINGE)
    case = scene(cable(), (held,), (floor,), (move(Target("g", by=(0.05, 0.0, 0.0))),))
    with playing(case, asker, straight(16)) as played:
        for shape in played.on(played.stage.path.steps - 1):
            before = shape
        shape = played.to()
        speed = (shape.nodes[-1, 0] - before.nodes[-1, 0]) / case.time_step
        share = speed / np.hypot(speed, SPEED) if kind is Friction.REGULARIZED else 1.0
        middle = 0.5 * (shape.s[1:] + shape.s[:-1])
        off = float(np.abs(shape.tension - mu * share * WEIGHT * middle).max())
        yield Check("tension", off / (1 + mu) / WEIGHT, 1e-5, "of the weight and friction")
        yield from played.checks()
        yield from coulomb(played, mu)


def _sloped(share: float, asker: Asker) -> Iterable[Check]:
    """Drawn up the slope by its upper end, T = w s (sin + mu cos); let down, it follows only beyond the limit, T = w s (sin - mu cos)."""
    mu = 0.3
    tilt = float(np.arctan(share * mu))
    along, normal = np.array([np.cos(tilt), 0.0, -np.sin(tilt)]), np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    held = gripper(0.0, RADIUS * normal, (along[0], 0.0, along[2]), hold=Hold.HINGE)
    way = 0.01 * along
    moves = tuple(move(Target("g", by=tuple(sign * way)), name=name) for name, sign in (("up", -1.0), ("down", 1.0)))
    moves = (moves[0], move(name="rest"), moves[1]) if share > 1.0 else (moves[0], move(name="rest", seconds=3.0))
    with playing(scene(cable(), (held,), (plane(tilt=tilt, **rough(Friction.SIGNUM, mu)),), moves), asker, straight(16, -tilt)) as played:
        drawn = played.to(10)
        middle = 0.5 * (drawn.s[1:] + drawn.s[:-1])
        tension = WEIGHT * (1.0 - middle) * (np.sin(tilt) + mu * np.cos(tilt))
        yield Check("tension, drawn up", float(np.abs(drawn.tension - tension).max()) / WEIGHT, 1e-5, "of the weight")
        rested = played.to(10)
        shape = played.to()
        if share > 1.0:
            tension = WEIGHT * (1.0 - middle) * (np.sin(tilt) - mu * np.cos(tilt))
            yield Check("tension, let down", float(np.abs(shape.tension - tension).max()) / WEIGHT, 1e-5, "of the weight")
        yield Check("creep at rest", float(np.abs((rested if share > 1.0 else shape).nodes - drawn.nodes).max()), 1e-9)
        yield from played.checks()
        yield from coulomb(played, mu)
