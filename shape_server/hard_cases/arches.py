"""Arches that snap, shapes that come in pairs, and starts in a plane that must be left.

Without weight a shape turned by half a turn about its chord is a shape of the problem turned the same way. So the way an arch goes up
under a load from -F to F is the image of the way down, snap and hysteresis included, and shapes above and below the chord come in pairs
of one energy.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise
from types import ModuleType
from typing import Final

import msgspec
import numpy as np

from protocol.hard_case import Case, Check, Declined, Unsound
from protocol.kinds import Hold, Model
from protocol.messages import PointLoads, Problem, Shape, Start
from protocol.scene import Vector

from .answers import found
from .balance import balance
from .posing import ALONG_X, GRAVITY, WEIGHTLESS, apart, cable, frame, going_on, grasps, place, span

FAMILY: Final = "arches and branches"
OVER: Final = np.array([1.0, -1.0, -1.0])  # half a turn about x
STEPS: Final = 24


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for chord in (0.98, 0.95, 0.9, 0.8):
        for hold in (Hold.CLAMP, Hold.HINGE):
            yield Case(f"arch, {hold.value}s at {chord:g}, loaded up and down", FAMILY, partial(_loaded_both_ways, chord, hold))
        yield Case(f"arch, clamps at {chord:g}, turned up and down", FAMILY, partial(_turned_both_ways, chord))
        yield Case(f"two shapes, clamps at {chord:g}, under weight", FAMILY, partial(_two_branches, chord, GRAVITY))
        yield Case(f"two shapes, clamps at {chord:g}, weight upwards is the mirror", FAMILY, partial(_mirrored_branches, chord))
        yield Case(f"below and above, clamps at {chord:g}, no weight", FAMILY, partial(_pair, chord))
    for chord in (0.3, 0.1, 0.0):
        yield Case(f"plane loop, ends at {chord:g}, soft in twist", FAMILY, partial(_plane_loop, chord))
    yield Case("more branches asked for than there are", FAMILY, partial(_too_many_branches, 50), may_decline=True)


def _pressed(chord: float, hold: Hold, up: float, segments: int = 60) -> Problem:
    """A rod without weight bowed up (1) or down (-1) in the plane x-z, stiff in twist so that it stays there."""
    s = np.linspace(0.0, 1.0, segments + 1)
    waves, size = (2.0 if hold is Hold.CLAMP else 1.0), 2 * np.sqrt(1 - chord)
    middle = (s[1:] + s[:-1]) / 2
    slope = up * size * (np.sin(waves * np.pi * middle) if hold is Hold.CLAMP else np.cos(np.pi * middle))
    frames = np.array([frame((np.cos(a), 0.0, np.sin(a)), (-np.sin(a), 0.0, np.cos(a))) for a in slope])
    force = (waves * np.pi) ** 2
    start = Start(s=s, frames=frames, grasp_forces=np.array([[force, 0.0, 0.0], [-force, 0.0, 0.0]]))
    return msgspec.structs.replace(_plain(chord, hold), start=start)


def _plain(chord: float, hold: Hold = Hold.CLAMP) -> Problem:
    rod = replace(cable(bending=20.0, twist=50.0, mass=0.0), bending_2=1.0)
    return Problem(cable=rod, grasps=span(chord, hold=hold), model=Model.ROD)


def _loaded(problem: Problem, force: float) -> Problem:
    loads = PointLoads(s=np.array([0.45]), force=np.array([[0.0, 0.0, force]]))
    return msgspec.structs.replace(problem, loads=loads)


def _sweep(problem: Problem, forces: np.ndarray, path: ModuleType) -> list[Shape]:
    shapes: list[Shape] = []
    for force in forces:
        problem = _loaded(problem, float(force))
        shapes.append(found(problem, WEIGHTLESS, path, extrapolate=False))
        problem = going_on(problem, shapes[-1])
    return shapes


def _loaded_both_ways(chord: float, hold: Hold, path: ModuleType) -> Iterable[Check]:
    """Aside of the middle by a twentieth, so that it is clear to which side the arch goes."""
    most = 120.0 if hold is Hold.CLAMP else 30.0
    forces = np.linspace(-most, most, STEPS) * np.sqrt(1 - chord) / np.sqrt(0.1)
    rising = _sweep(_pressed(chord, hold, -1.0), forces, path)
    falling = _sweep(_pressed(chord, hold, 1.0), -forces, path)
    heights = np.array([[float(place(shape, 0.5)[2]) for shape in way] for way in (rising, falling)])
    yield Check("way up against the image of the way down", float(np.abs(heights.sum(axis=0)).max()), 1e-5)
    for way in (rising, falling):
        for before, after in pairwise(way):
            if after.sentence == "settled from the start shape":
                yield Check("jump without a word", apart(before, after), 0.1)
    yield Check("arch not snapped over", float(heights[0, 0] - heights[0, -1]), 1e-9)


def _turned_both_ways(chord: float, path: ModuleType) -> Iterable[Check]:
    """Both clamps turned up to half a radian and back beyond: the two ways are images of each other."""
    heights = []
    for sign in (1.0, -1.0):
        problem, way = _pressed(chord, Hold.CLAMP, sign), []
        for angle in sign * np.concatenate([np.linspace(0.0, -0.5, 12), np.linspace(-0.45, 0.5, 20)]):
            first, last = (frame((np.cos(a), 0.0, np.sin(a)), (-np.sin(a), 0.0, np.cos(a))) for a in (angle, -0.9 * angle))
            held = grasps((0.0, (0, 0, 0), first), (1.0, (chord, 0, 0), last))
            problem = msgspec.structs.replace(problem, grasps=held)
            shape = found(problem, WEIGHTLESS, path, extrapolate=False)
            way.append(float(place(shape, 0.5)[2]))
            problem = going_on(problem, shape)
        heights.append(np.array(way))
    yield Check("way up against the image of the way down", float(np.abs(heights[0] + heights[1]).max()), 1e-5)


def _branches(chord: float, gravity: Vector, path: ModuleType) -> list[Shape]:
    problem = Problem(cable=cable(bending=1e-1), grasps=span(chord), model=Model.ROD)
    return [found(msgspec.structs.replace(problem, branch=k), gravity, path) for k in (1, 2)]


def _two_branches(chord: float, gravity: Vector, path: ModuleType) -> Iterable[Check]:
    shapes = _branches(chord, gravity, path)
    yield Check("energy of the first above that of the second", shapes[0].energy - shapes[1].energy, 1e-9, "J")
    distance = float(np.linalg.norm(shapes[0].nodes - place(shapes[1], shapes[0].s), axis=1).max())
    yield Check("likeness of the two", 1e-3 / max(distance, 1e-300), 1.0, "of what tells two shapes apart")
    problem = Problem(cable=cable(bending=1e-1), grasps=span(chord), model=Model.ROD)
    for shape in shapes:
        yield from balance(problem, shape, gravity)


def _mirrored_branches(chord: float, path: ModuleType) -> Iterable[Check]:
    down, up = _branches(chord, GRAVITY, path), _branches(chord, (0.0, 0.0, 9.81), path)
    for one, other in zip(down, up, strict=True):
        yield Check("energy against that of the mirror image", abs(one.energy - other.energy) / abs(one.energy), 1e-3, "of it")


def _pair(chord: float, path: ModuleType) -> Iterable[Check]:
    below, above = (found(_pressed(chord, Hold.CLAMP, up), WEIGHTLESS, path, extrapolate=False) for up in (-1.0, 1.0))
    yield Check("image of the one from the other", float(np.linalg.norm(above.nodes - below.nodes * OVER, axis=1).max()), 1e-6)
    yield Check("difference in energy", abs(above.energy - below.energy) / above.energy, 1e-7, "of it")


def _plane_loop(chord: float, path: ModuleType) -> Iterable[Check]:
    """A plane loop between clamps: stays if it is stable in three dimensions, else opens out of its plane."""
    s = np.linspace(0.0, 1.0, 121)
    slope = 2 * np.pi * (s[1:] + s[:-1]) / 2
    frames = np.array([frame((np.cos(a), 0.0, np.sin(a)), (-np.sin(a), 0.0, np.cos(a))) for a in slope])
    start = Start(s=s, frames=frames, grasp_forces=np.zeros((2, 3)))
    rod = cable(bending=1.0, twist=0.1, mass=0.0)
    held = grasps((0.0, (0, 0, 0), ALONG_X), (1.0, (chord, 0, 0), ALONG_X))
    problem = Problem(cable=rod, grasps=held, start=start, model=Model.ROD)
    shape = found(problem, WEIGHTLESS, path, extrapolate=False)
    return balance(problem, shape, WEIGHTLESS)


def _too_many_branches(count: int, path: ModuleType) -> Iterable[Check]:
    problem = Problem(cable=cable(bending=1e-1), grasps=span(0.9), branch=count, model=Model.ROD)
    try:
        found(problem, GRAVITY, path)
    except Declined as declined:
        if "branch" not in str(declined) and "shape" not in str(declined):
            raise Unsound(f"refused for another reason: {declined}") from declined
        raise
    raise Unsound(f"a shape number {count} where there are a few")
