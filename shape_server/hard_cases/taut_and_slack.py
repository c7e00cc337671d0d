"""Taut and slack: length over chord from 1 + 1e-8 to 50, no slack at all, folded flat, upright, upside down, without gravity."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from types import ModuleType
from typing import Final

import numpy as np

from protocol.hard_case import Case, Check
from protocol.kinds import Hold, Model
from protocol.messages import Grasps, Problem
from protocol.scene import Vector

from .answers import found, refused
from .balance import balance
from .posing import ALONG_X, DOWN, GRAVITY, UP, WEIGHTLESS, cable, frame, grasps, place, span
from .references import catenary

FAMILY: Final = "taut and slack"
SLACKS: Final = (1e-8, 1e-6, 1e-4, 1e-2, 0.1, 1.0, 10.0, 49.0)
SLOPES: Final[dict[str, Vector]] = {"level": (1.0, 0.0, 0.0), "rising": (0.8, 0.0, 0.6), "steep fall": (0.28, 0.0, -0.96)}
AXES: Final[dict[str, Vector]] = {"level": (1.0, 0.0, 0.0), "upright": (0.0, 0.0, 1.0), "hanging down": (0.0, 0.0, -1.0)}
ENDS: Final = {"hanging": (DOWN, UP), "standing": (UP, DOWN), "ring": (ALONG_X, ALONG_X)}
GRAVITIES: Final[dict[str, Vector]] = {
    "no gravity": WEIGHTLESS,
    "gravity upwards": (0.0, 0.0, 9.81),
    "gravity along the cable": (9.81, 0.0, 0.0),
    "gravity against the cable": (-9.81, 0.0, 0.0),
    "hardly any gravity": (0.0, 0.0, -1e-9),
    "gravity of a thousand g": (0.0, 0.0, -9810.0),
}


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for slack in SLACKS:
        for name, axis in SLOPES.items():
            yield Case(f"catenary, slack {slack:g}, {name}", FAMILY, partial(_catenary, slack, axis))
        yield Case(f"soft rod against the catenary, slack {slack:g}", FAMILY, partial(_soft_rod, slack))
    for slack in (1e-2, 1e-4, 1e-6, 1e-8):
        for name, axis in AXES.items():
            yield Case(f"taut rod, slack {slack:g}, {name}", FAMILY, partial(_taut_rod, slack, axis))
    for slack in (1e-3, 1e-4, 1e-5, 1e-6):
        yield Case(f"pull of a taut string, slack {slack:g}", FAMILY, partial(_taut_pull, slack))
    for chord in (1.0 - 1e-13, 1.0, 1.0 + 1e-9, 1.01, 2.0):
        for hold in (Hold.CLAMP, Hold.HINGE):
            for bending in (1e-2, None):
                text = f"chord {chord:.14g} of 1 m, {hold.value}, " + ("with bending" if bending else "without bending")
                too_far = bending is not None or chord > 1.0
                measure = partial(_too_far, chord, hold, bending) if too_far else partial(_no_slack, chord, hold)
                yield Case(text, FAMILY, measure, may_decline=too_far)
    for hold in Hold:
        near = span(1 - 1e-6, hold=hold)
        yield Case(f"a micrometre short of the full length, {hold.value}s", FAMILY, partial(_rod, near, 1e-2, GRAVITY))
        for count in (10, 30):
            many = grasps(*[(s, (0.9 * s, 0.0, 0.0), ALONG_X) for s in np.linspace(0, 1, count)], hold=hold)
            yield Case(f"held at {count} points, {hold.value}s", FAMILY, partial(_answered, many), may_decline=hold is Hold.GUIDE)
    for bending in (1e-2, 1e-3, 1e-4):
        yield Case(f"fifty times as long as the chord, EI {bending:g}", FAMILY, partial(_rod, span(0.02), bending, GRAVITY))
        for name, (first, last) in ENDS.items():
            yield Case(f"ends at one place, {name}, EI {bending:g}", FAMILY, partial(_one_place, first, last, bending))
        flat = grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (1.0, (0.0, 0.0, -0.01), frame((-1.0, 0.0, 0.0))))
        yield Case(f"folded flat, EI {bending:g}", FAMILY, partial(_rod, flat, bending, GRAVITY))
    askew = grasps((0.0, (0.0, 0.0, 0.0), ALONG_X), (1.0, (0.5, 0.2, 0.1), ALONG_X))
    for bending in (1e-2, 1e-3):
        for name, gravity in GRAVITIES.items():
            yield Case(f"{name}, EI {bending:g}", FAMILY, partial(_rod, askew, bending, gravity))
        yield Case(f"upside down is the mirror image, EI {bending:g}", FAMILY, partial(_upside_down, bending))


def _catenary(slack: float, axis: Vector, path: ModuleType) -> Iterable[Check]:
    end = np.array(axis) / (1 + slack)
    reference = catenary(end[0], end[2], 1.0, 0.981)
    shape = found(Problem(cable=cable(bending=None), grasps=grasps((0.0, (0, 0, 0), ALONG_X), (1.0, end, ALONG_X))), GRAVITY, path)
    yield Check("place of a node", float(np.linalg.norm(shape.nodes - reference.at(shape.s), axis=1).max()), 1e-7)
    # The force of a taut cable goes with the root of the slack, of which 1 - chord keeps 1e-16 / slack.
    force = -shape.grasp_wrenches[0, :3] - (reference.horizontal, 0.0, reference.vertical)
    size = float(np.hypot(reference.horizontal, reference.vertical))
    yield Check("force at the start", float(np.linalg.norm(force)) / size, 1e-8 + 1e-15 / slack, "of it")


def _soft_rod(slack: float, path: ModuleType) -> Iterable[Check]:
    """Away from the clamps the rod hangs as the catenary, but for the layers in which it bends."""
    chord, bending = 1 / (1 + slack), 1e-8
    reference = catenary(chord, 0.0, 1.0, 0.981)
    problem = Problem(cable=cable(bending=bending), grasps=span(chord), model=Model.ROD)
    shape = found(problem, GRAVITY, path)
    layer = 1.3 * np.sqrt(bending / np.hypot(reference.horizontal, reference.vertical))
    bottom = np.cbrt(bending / 0.981)  # the width below which the weight cannot bend the rod
    inner = (shape.s > 0.05) & (shape.s < 0.95)
    off = float(np.linalg.norm(shape.nodes - reference.at(shape.s), axis=1)[inner].max())
    yield Check("place of a node", off, 1e-3 + 2 * layer + (bottom if slack > 1 else 0.0), told=shape.error or 0.0)
    yield from balance(problem, shape, GRAVITY)


def _taut_rod(slack: float, axis: Vector, path: ModuleType) -> Iterable[Check]:
    """A cable of length 1 + e over a chord of 1 rises by sqrt(3 e / 8) as an arc, and by sqrt(e / 2) as a fold."""
    held = grasps((0.0, (0, 0, 0), frame(axis)), (1.0, np.array(axis) / (1 + slack), frame(axis)))
    problem = Problem(cable=cable(), grasps=held, model=Model.ROD)
    shape = found(problem, GRAVITY, path)
    yield Check("distance from the chord", float(np.linalg.norm(np.cross(shape.nodes, axis), axis=1).max()), float(np.sqrt(slack / 2)))
    yield from balance(problem, shape, GRAVITY)


def _taut_pull(slack: float, path: ModuleType) -> Iterable[Check]:
    """H = w L / sqrt(24 e) without bending; the layers of sqrt(EI / H) at both clamps take slack and so add to it."""
    bending, chord = 1e-7, 1 / (1 + slack)
    pull = catenary(chord, 0.0, 1.0, 0.981).horizontal
    shape = found(Problem(cable=cable(bending=bending), grasps=span(chord), model=Model.ROD), GRAVITY, path, tolerance=1e-5)
    layers = 4 * float(np.sqrt(bending / pull))
    yield Check("pull", abs(float(shape.grasp_wrenches[1, 0]) / pull - 1), 1e-3 + layers, "of it")


def _too_far(chord: float, hold: Hold, bending: float | None, path: ModuleType) -> Iterable[Check]:
    words = "bring them closer" if bending else "further than"
    return refused(Problem(cable=cable(bending=bending), grasps=span(chord, hold=hold)), GRAVITY, path, words)


def _no_slack(chord: float, hold: Hold, path: ModuleType) -> Iterable[Check]:
    """Without bending and without slack the one shape possible is the chord; no force is large enough, so that none is checked."""
    problem = Problem(cable=cable(bending=None), grasps=span(chord, hold=hold))
    shape = found(problem, GRAVITY, path)
    yield Check("distance from the chord", float(np.abs(shape.nodes[:, 1:]).max()), 1e-6)
    yield from balance(problem, shape, GRAVITY)


def _rod(held: Grasps, bending: float, gravity: Vector, path: ModuleType) -> Iterable[Check]:
    problem = Problem(cable=cable(bending=bending), grasps=held, model=Model.ROD)
    return balance(problem, found(problem, gravity, path), gravity)


def _answered(held: Grasps, path: ModuleType) -> Iterable[Check]:
    problem = Problem(cable=cable(), grasps=held)
    return list(balance(problem, found(problem, GRAVITY, path), GRAVITY))[1:]


def _one_place(first: np.ndarray, last: np.ndarray, bending: float, path: ModuleType) -> Iterable[Check]:
    problem = Problem(cable=cable(bending=bending), grasps=grasps((0.0, (0, 0, 0), first), (1.0, (0, 0, 0), last)), model=Model.ROD)
    shape = found(problem, GRAVITY, path)
    yield Check("distance of the middle from half the length", 0.5 - float(np.linalg.norm(shape.nodes, axis=1).max()), 0.5)
    yield Check("two ends at one place", float(np.linalg.norm(shape.nodes[-1])), 1e-8)
    yield from balance(problem, shape, GRAVITY)


def _upside_down(bending: float, path: ModuleType) -> Iterable[Check]:
    """A half turn about the chord turns gravity, and with it the whole shape."""
    problem = Problem(cable=cable(bending=bending), grasps=span(0.6), model=Model.ROD)
    below, above = found(problem, GRAVITY, path), found(problem, (0.0, 0.0, 9.81), path)
    yield Check("place of a node", float(np.linalg.norm(above.nodes - place(below, above.s) * (1, -1, -1), axis=1).max()), 1e-5)
