"""Stiffness and size: EI, EA, GJ and length over many decades, and properties that jump along the cable."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from types import ModuleType
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.hard_case import Case, Check
from protocol.kinds import Hold, Model
from protocol.messages import Grasps, PointLoads, Problem
from protocol.scene import Section, Vector

from .answers import found
from .balance import balance
from .posing import ALONG_X, GRAVITY, WEIGHTLESS, cable, frame, grasps, place, span
from .references import catenary, elastic_catenary

FAMILY: Final = "stiffness"
ASKEW: Final = frame((1.0, 0.5, 0.3), (0.0, 1.0, 1.0))
RATIOS: Final = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for power in range(-9, 4):
        bending = 10.0**power
        yield Case(f"EI {bending:g}, clamps level", FAMILY, partial(_bent, bending, ALONG_X))
        yield Case(f"EI {bending:g}, clamps askew", FAMILY, partial(_bent, bending, ASKEW))
    for bending in (1e-5, 1e-6, 1e-7, 1e-8, 1e-9):
        yield Case(f"EI {bending:g} against the catenary", FAMILY, partial(_vanishing, bending))
    for power in range(1, 10):
        stretch = 10.0**power
        for chord in (0.6, 0.99, 1.05):
            yield Case(f"EA {stretch:g}, chord {chord:g}, catenary", FAMILY, partial(_elastic_catenary, stretch, chord))
        yield Case(f"EA {stretch:g}, rod pulled by a thousandth", FAMILY, partial(_pulled, stretch))
        yield Case(f"EA {stretch:g}, hanging rod", FAMILY, partial(_stretched, stretch))
    for ratio in RATIOS:
        yield Case(f"GJ/EI {ratio:g}, one end askew", FAMILY, partial(_twisted, ratio, 0.0))
        yield Case(f"GJ/EI {ratio:g}, one end turned by 2 rad", FAMILY, partial(_twisted, ratio, 2.0))
    for power in range(-3, 4):
        length = 10.0**power
        for name, last in (("level", ALONG_X), ("askew", ASKEW)):
            yield Case(f"length {length:g} m has the shape of 1 m, {name}", FAMILY, partial(_scaled, length, last))
        yield Case(f"length {length:g} m, the same EI", FAMILY, partial(_long, length))
    for factor in (1e-4, 1e-2, 1e2, 1e4):
        for at in (0.25, 0.5, 0.503):
            yield Case(f"EI jumps by {factor:g} at {at:g} m", FAMILY, partial(_jump_in_bending, factor, at))
        yield Case(f"EA jumps by {factor:g}", FAMILY, partial(_jump_in_stretch, factor))
        yield Case(f"GJ jumps by {factor:g}", FAMILY, partial(_jump_in_twist, factor))


def _held(last: np.ndarray, length: float = 1.0) -> Grasps:
    return grasps((0.0, (0, 0, 0), ALONG_X), (length, (0.7 * length, 0.1 * length, 0.0), last))


def _bent(bending: float, last: np.ndarray, path: ModuleType) -> Iterable[Check]:
    problem = Problem(cable=cable(bending=bending), grasps=_held(last), model=Model.ROD)
    return balance(problem, found(problem, GRAVITY, path), GRAVITY)


def _vanishing(bending: float, path: ModuleType) -> Iterable[Check]:
    reference = catenary(0.7, 0.0, 1.0, 0.981)
    shape = found(Problem(cable=cable(bending=bending), grasps=span(0.7), model=Model.ROD), GRAVITY, path, tolerance=1e-4)
    layer = float(np.sqrt(bending / np.hypot(reference.horizontal, reference.vertical)))
    off = float(np.linalg.norm(shape.nodes - reference.at(shape.s), axis=1).max())
    yield Check("distance from the catenary", off, 1e-4 + 2 * layer)


def _elastic_catenary(stretch: float, chord: float, path: ModuleType) -> Iterable[Check]:
    reference = elastic_catenary(chord, 0.0, 1.0, 0.981, stretch)
    shape = found(Problem(cable=replace(cable(bending=None), stretch=stretch), grasps=span(chord)), GRAVITY, path)
    yield Check("place of a node", float(np.linalg.norm(shape.nodes - reference.at(shape.s), axis=1).max()), 1e-7)
    force = -shape.grasp_wrenches[0, :3] - (reference.horizontal, 0.0, reference.vertical)
    size = float(np.hypot(reference.horizontal, reference.vertical))
    yield Check("force at the start", float(np.linalg.norm(force)) / size, 1e-6, "of it")


def _pulled(stretch: float, path: ModuleType) -> Iterable[Check]:
    """A straight rod without weight, longer by a thousandth: T = EA / 1000."""
    problem = Problem(cable=replace(cable(mass=0.0), stretch=stretch), grasps=span(1.001), model=Model.ROD)
    shape = found(problem, WEIGHTLESS, path)
    yield Check("tension", float(np.abs(shape.tension / (1e-3 * stretch) - 1).max()), 1e-6, "of it")
    yield Check("distance from the chord", float(np.abs(shape.nodes[:, 1:]).max()), 1e-9)


def _stretched(stretch: float, path: ModuleType) -> Iterable[Check]:
    problem = Problem(cable=replace(cable(bending=1e-3), stretch=stretch), grasps=_held(ALONG_X), model=Model.ROD)
    return balance(problem, found(problem, GRAVITY, path), GRAVITY)


def _twisted(ratio: float, turn: float, path: ModuleType) -> Iterable[Check]:
    """With the same stiffness about all directions the twist is even along the cable, however that bends: M = GJ twist / L."""
    last = (Rotation.from_quat(ASKEW) * Rotation.from_rotvec([0.0, 0.0, turn])).as_quat()
    problem = Problem(cable=cable(twist=1e-2 * ratio), grasps=_held(last), model=Model.ROD)
    shape = found(problem, GRAVITY, path)
    torque = float(shape.grasp_wrenches[1, 3:] @ Rotation.from_quat(last).apply([0.0, 0.0, 1.0]))
    scale = float(np.linalg.norm(shape.grasp_wrenches[1, 3:]))
    yield Check("torque against twist", abs(torque - 1e-2 * ratio * shape.total_twist) / scale, 2e-3, "of the moment")
    yield from balance(problem, shape, GRAVITY)


def _scaled(length: float, last: np.ndarray, path: ModuleType) -> Iterable[Check]:
    """EI grows with the cube of the length at the same weight per length: the shape is the same but for its size."""
    sizes = []
    for size in (1.0, length):
        problem = Problem(cable=cable(length=size, bending=1e-2 * size**3), grasps=_held(last, size), model=Model.ROD)
        sizes.append(found(problem, GRAVITY, path, tolerance=1e-3 * size))
    off = sizes[1].nodes / length - place(sizes[0], sizes[1].s / length)
    yield Check("place of a node", float(np.linalg.norm(off, axis=1).max()), 1e-6, "of the length")


def _long(length: float, path: ModuleType) -> Iterable[Check]:
    problem = Problem(cable=cable(length=length), grasps=_held(ALONG_X, length), model=Model.ROD)
    return balance(problem, found(problem, GRAVITY, path, tolerance=1e-3 * length), GRAVITY)


def _jump_in_bending(factor: float, at: float, path: ModuleType) -> Iterable[Check]:
    """A cantilever with a small force F across its tip: it gives by int F (L - s)^2 / EI ds."""
    soft = min(1.0, factor)
    give = (1 - (1 - at) ** 3) / 3 + (1 - at) ** 3 / 3 / factor
    force = 1e-3 / give  # so that the tip moves by a thousandth of the length, and the cosine of the slope is one
    rod = replace(cable(bending=1.0, twist=1.0, mass=0.0), sections=(Section(start=at, end=1.0, bending=factor, twist=soft),))
    loads = PointLoads(s=np.array([1.0]), force=np.array([[0.0, 0.0, force]]))
    problem = Problem(cable=rod, grasps=grasps((0.0, (0, 0, 0), ALONG_X)), loads=loads, model=Model.ROD)
    shape = found(problem, WEIGHTLESS, path, tolerance=1e-6)
    yield Check("give of the tip", abs(float(shape.nodes[-1, 2]) - 1e-3), 2e-6, told=shape.error or 0.0)


def _jump_in_stretch(factor: float, path: ModuleType) -> Iterable[Check]:
    """Two parts in line share one tension: T = elongation / sum of L_i / EA_i."""
    rod = replace(cable(mass=0.0), stretch=1e5, sections=(Section(start=0.4, end=1.0, stretch=1e5 * factor),))
    tension = 1e-3 / (0.4 / 1e5 + 0.6 / (1e5 * factor))
    shape = found(Problem(cable=rod, grasps=span(1.001, hold=Hold.CLAMP), model=Model.ROD), WEIGHTLESS, path)
    yield Check("tension", float(np.abs(shape.tension / tension - 1).max()), 1e-6, "of it")


def _jump_in_twist(factor: float, path: ModuleType) -> Iterable[Check]:
    """Two parts in line share one torque: M = turn / sum of L_i / GJ_i, below what would throw a loop, on a cable pulled straight."""
    turn: float = 0.1
    rod = replace(cable(mass=0.0), stretch=1e5, sections=(Section(start=0.4, end=1.0, twist=8e-3 * factor),))
    torque = turn / (0.4 / 8e-3 + 0.6 / (8e-3 * factor))
    last = (Rotation.from_quat(ALONG_X) * Rotation.from_rotvec([0.0, 0.0, turn])).as_quat()
    end: Vector = (1.001, 0.0, 0.0)
    problem = Problem(cable=rod, grasps=grasps((0.0, (0, 0, 0), ALONG_X), (1.0, end, last)), model=Model.ROD)
    shape = found(problem, WEIGHTLESS, path)
    yield Check("torque", abs(float(shape.grasp_wrenches[1, 3]) / torque - 1), 1e-3, "of it")
