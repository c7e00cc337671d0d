"""Floors that every node of the cable knows, up to 400 contacts at once, and floors that hardly touch."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from types import ModuleType
from typing import Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import Model
from protocol.messages import Problem

from .answers import found
from .balance import balance
from .posing import GRAVITY, RADIUS, Row, apart, cable, contacts, place, span, start_from
from .sagging import free

FAMILY: Final = "floors"
FLICKERS: Final = (1e-12, 1e-10, 1e-8, 1e-6, -1e-12, -1e-10, -1e-8, -1e-6)


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for count in (50, 100, 200, 400):
        for rise in (1e-3, 5e-2, 0.15):
            heavy = count > 200 or (count == 200 and rise > 0.1)
            yield Case(f"floor with {count} contacts, {rise:g} m up", FAMILY, partial(_floor, count, rise, False), is_slow=heavy)
            yield Case(f"floor with {count} contacts, {rise:g} m up, cold", FAMILY, partial(_floor, count, rise, True), is_slow=heavy)
    for gap in FLICKERS:
        yield Case(f"contact that flickers, gap {gap:g} m", FAMILY, partial(_flicker, gap))


def _floor(count: int, rise: float, is_cold: bool, path: ModuleType) -> Iterable[Check]:
    floor = float(free(path).nodes[:, 2].min()) + rise
    places = np.linspace(0.0, 1.0, count + 1)[3:-3]
    rows = [Row(s=float(s), point=(0.0, 0.0, floor - RADIUS)) for s in places]
    start = None if is_cold else start_from(free(path, count))
    problem = Problem(cable=cable(), grasps=span(), contacts=contacts(*rows), start=start, model=Model.ROD)
    shape = found(problem, GRAVITY, path, extrapolate=False)
    yield from list(balance(problem, shape, GRAVITY))[1:]
    yield Check("pull of the floor", -float(shape.contact_forces[:, 2].min()), 1e-9, "N")
    yield Check("penetration of the floor", floor - float(place(shape, places)[:, 2].min()), 1e-5, told=shape.error or 0.0)


def _flicker(gap: float, path: ModuleType) -> Iterable[Check]:
    """A floor at a gap from where it is touched, above and below in turn."""
    begin = free(path)
    low, shape = float(begin.nodes[:, 2].min()), begin
    for k in range(6):
        rows = [Row(s=float(s), point=(0.0, 0.0, low + gap * (-1) ** k - RADIUS)) for s in begin.s[2:-2]]
        problem = Problem(cable=cable(), grasps=span(), contacts=contacts(*rows), start=start_from(shape), model=Model.ROD)
        shape = found(problem, GRAVITY, path, extrapolate=False)
        yield Check("force of a contact that hardly touches", float(np.abs(shape.contact_forces).sum()), 1e-6 + 2e2 * abs(gap), "N")
        yield Check("distance from the free shape", apart(shape, begin), 1e-8 + 2 * abs(gap))
        yield from list(balance(problem, shape, GRAVITY))[1:]
