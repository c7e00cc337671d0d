"""A cable over a peg: the capstan just below and above its limit, and pulled down until it slides off.

One end is in a gripper that goes down on the left, the other hangs on the right, with a mass at its end or without. Reference: T2 / T1 =
exp(mu pi) while it slides up, exp(-mu pi) while it slides back, and between them whatever was, without creep, while it sticks (Euler 1769).
Once off the peg, it hangs straight down from the gripper.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import Friction, Hold, Primitive
from protocol.messages import Shape, Start
from protocol.scene import Body, Cable, LumpedMass, Target

from ..asking import Asker
from .laying import gripper, lying, move, rough, scene
from .playing import playing
from .rubbing import coulomb

FAMILY: Final = "over a peg"
RADIUS, OWN, LENGTH, SEGMENTS = 0.05, 0.0045, 0.4, 48  # m
REACH: Final = RADIUS + OWN
LEG: Final = 0.5 * (LENGTH - np.pi * REACH)
SLIDE: Final = 3e-3  # m, in ten steps


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for mu in (0.0, 0.05, 0.1, 0.3, 0.6):
        hard = mu > 0.5  # steps are found by relaxing, in seconds each
        yield Case(f"capstan, mu {mu:g}: drawn up, and drawn on after a rest", FAMILY, partial(_drawn, mu), is_slow=hard, may_decline=hard)
        yield Case(f"capstan, mu {mu:g}: eased by 0.1 um, and at rest", FAMILY, partial(_eased, mu), is_slow=hard, may_decline=hard)
        if not hard:
            yield Case(f"capstan, mu {mu:g}: let down", FAMILY, partial(_let_down, mu))
    for mu in (0.1, 0.3, 1.0):
        yield Case(f"slack, laid on a rough peg, mu {mu:g}", FAMILY, partial(_laid, mu))
    for friction, mass in ((Friction.NONE, 0.0), (Friction.NONE, 0.1), (Friction.SIGNUM, 0.0)):
        name = f"slides off a cylinder, {friction.value}, with {mass:g} kg at its end"
        yield Case(name, FAMILY, partial(_off, friction, mass), is_slow=True, may_decline=True)


def _laid(mu: float, asker: Asker) -> Iterable[Check]:
    """Both ends of a slack cable go down beside a peg, in its plane.

    On one place it could turn about the vertical and buckle sideways, on two that stick it is held: which of the two depends on how it came
    to rest. What begins to slide is held across its slip, and no step is to end in a search without end.
    """
    held = Cable("c", 1.0, 6e-3, 0.06, 2e-3, 2e-3)
    hands = tuple(gripper(at, (at - 0.5 + 0.1 * sign, 0.0, 0.4), name=name) for at, sign, name in ((0.0, 1, "left"), (1.0, -1, "right")))
    down = move(*(Target(hand.name, by=(0.0, 0.0, -0.2)) for hand in hands))
    peg = replace(_peg(**rough(Friction.SIGNUM, mu)), radius=0.04)
    case = scene(held, hands, (peg,), (down,), time_step=0.05, tolerance=5e-4)
    with playing(case, asker) as played:
        played.to()
        yield from played.checks()
        yield from coulomb(played, mu)


def _start(pull: float) -> Start:
    s = np.linspace(0.0, LENGTH, SEGMENTS + 1)
    turned = np.clip((0.5 * (s[1:] + s[:-1]) - LEG) / REACH, 0.0, np.pi)
    return lying(0.5 * np.pi - turned, s, (0.0, 0.0, -pull))


def _peg(**law: Any) -> Body:
    across = (float(np.sqrt(0.5)), 0.0, 0.0, float(np.sqrt(0.5)))
    return Body("peg", shape=Primitive.CYLINDER, radius=RADIUS, length=0.4, quaternion=across, **law)


def _capstan(mu: float, *ways: float) -> Any:
    """A light cable with a mass of a newton, whose gripper goes down by so much, one after the other, ten steps each."""
    held = Cable("c", LENGTH, 2 * OWN, 1e-6, 1e-5, 1e-5, masses=(LumpedMass(LENGTH, 1.0 / 9.81),))
    hand = gripper(0.0, (-REACH, 0.0, -LEG), (0.0, 0.0, 1.0), hold=Hold.HINGE)
    moves = tuple(move(Target("g", by=(0.0, 0.0, -way)), name=str(k)) for k, way in enumerate(ways))
    # No finer nodes than those of the start: the reference is the measure here, and shapes on four times as many take seconds.
    return scene(held, (hand,), (_peg(**rough(Friction.SIGNUM, mu)),), moves, tolerance=1.0)


def _ratio(shape: Shape) -> float:
    return float(shape.tension[0] / shape.tension[-1])


def _off_limit(what: str, shape: Shape, mu: float) -> Check:
    """Bending costs EI / 2 R^2 on each side, and the chords of the mesh a share of the turn."""
    return Check(what, abs(_ratio(shape) / float(np.exp(mu * np.pi)) - 1), 0.01 + 0.03 * abs(mu), "of it")


def _drawn(mu: float, asker: Asker) -> Iterable[Check]:
    with playing(_capstan(mu, SLIDE, 0.0, SLIDE), asker, _start(1.0), is_loose=True) as played:
        yield _off_limit("ratio of the tensions, drawn up", played.to(6), mu)
        yield _off_limit("ratio of the tensions, drawn on", played.to(20), mu)
        yield from coulomb(played, mu, within=1e-3)
        played.to()
        yield from played.checks()


def _eased(mu: float, asker: Asker) -> Iterable[Check]:
    with playing(_capstan(mu, SLIDE, -1e-7, 0.0, 0.0, SLIDE), asker, _start(1.0), is_loose=True) as played:
        played.to(10)
        eased = played.to(10)
        rested = played.to(20)
        creep = float(np.abs(rested.nodes - eased.nodes).max())
        yield Check("creep at rest", creep, 1e-9)
        yield Check("ratio of the tensions above the limit", _ratio(rested) / float(np.exp(mu * np.pi)) - 1, 0.01 + 0.03 * mu, "of it")
        yield _off_limit("ratio of the tensions, drawn on", played.to(6), mu)
        yield from coulomb(played, mu, within=1e-3)
        played.to()
        yield from played.checks()


def _let_down(mu: float, asker: Asker) -> Iterable[Check]:
    with playing(_capstan(mu, SLIDE, -SLIDE), asker, _start(1.0), is_loose=True) as played:
        yield _off_limit("ratio of the tensions, let down", played.to(16), -mu)
        yield from coulomb(played, mu, within=1e-3)
        played.to()
        yield from played.checks()


def _off(friction: Friction, mass: float, asker: Asker) -> Iterable[Check]:
    """The gripper goes down by nearly the whole length: the free end comes up, over the peg, and falls.

    Without a mass nor friction the cable is on the peg for as long only as less of it hangs on the side of the gripper: it snaps at once.
    """
    held = Cable("c", LENGTH, 2 * OWN, 0.1, 1e-5, 1e-5, masses=(LumpedMass(LENGTH, mass),) if mass else ())
    hand = gripper(0.0, (-REACH, 0.0, -LEG), (0.0, 0.0, 1.0), hold=Hold.HINGE)
    down = move(Target("g", by=(0.0, 0.0, -0.9 * LENGTH)), seconds=6.0)
    with playing(scene(held, (hand,), (_peg(**rough(friction, 0.3)),), (down,)), asker, _start(0.1), is_loose=True) as played:
        shape = played.to()
        straight = np.column_stack([0.0 * shape.s - REACH, 0.0 * shape.s, -LEG - 0.9 * LENGTH - shape.s])
        yield Check("distance from hanging straight down", float(np.abs(shape.nodes - straight).max()), 1e-6)
        yield from played.checks(snaps=4)
