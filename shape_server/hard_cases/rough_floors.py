"""Floors that rub: up to 200 contacts at once, each of which sticks, slides or opens by its law."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from types import ModuleType
from typing import Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import Friction, Model
from protocol.messages import FrictionLaw, FrictionTable, Problem

from .answers import found
from .balance import balance
from .posing import GRAVITY, RADIUS, Row, cable, contacts, place, rubbing, span, start_from
from .sagging import free

FAMILY: Final = "rough floors"
LAWS: Final = {
    Friction.SIGNUM: FrictionLaw(coefficient=0.4),
    Friction.REGULARIZED: FrictionLaw(coefficient=0.4, speed=0.03),
    Friction.DEFINED: FrictionLaw(table=FrictionTable(speeds=np.array([0.0, 1.0]), normals=np.ones(1), forces=np.full((2, 1), 0.4))),
}


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for count in (20, 50, 100, 200):
        for kind, law in LAWS.items():
            may = kind is Friction.REGULARIZED
            yield Case(
                f"floor with {count} contacts that rub, {kind.value}",
                FAMILY,
                partial(_rough, count, kind, law),
                is_slow=count > 50 or may,
                may_decline=may,
            )


def _rough(count: int, kind: Friction, law: FrictionLaw, path: ModuleType) -> Iterable[Check]:
    """A floor that comes up, under a cable that was 2 mm aside before: no contact pulls, none bears more than mu N along the floor."""
    begin = free(path, count)
    floor = float(begin.nodes[:, 2].min()) + 5e-2
    places = np.linspace(0.0, 1.0, count + 1)[3:-3]
    rows = contacts(*(Row(s=float(s), point=(0.0, 0.0, floor - RADIUS)) for s in places))
    rough = rubbing(rows, kind, law, place(begin, places) + np.array([2e-3, 1e-3, 0.0]))
    problem = Problem(cable=cable(), grasps=span(), contacts=rough, start=start_from(begin), model=Model.ROD)
    shape = found(problem, GRAVITY, path, extrapolate=False)
    yield from list(balance(problem, shape, GRAVITY))[1:]
    push, along = shape.contact_forces[:, 2], np.linalg.norm(shape.contact_forces[:, :2], axis=1)
    yield Check("pull of the floor", -float(push.min()), 1e-9, "N")
    yield Check("friction above mu N", float((along - 0.4 * push).max()) / float(push.sum()), 1e-6, "of all pushes")
    yield Check("friction that is missing", 1e-3 - float(along.sum() / push.sum()), 1e-9, "of all pushes")
    yield Check("penetration of the floor", floor - float(place(shape, places)[:, 2].min()), 1e-5, told=shape.error or 0.0)
