"""Whole turns of twist between clamps: what is put in stays in, as twist or as loops.

Calugareanu 1959, White 1969, Fuller 1971: a ribbon along a closed curve has a linking number Lk = Tw + Wr, which is a whole number and
changes only where the curve passes through itself, then by two; nothing in the solver forbids that, so it must be told. Here the cable
is closed by a wide plane detour from its last end to its first, without twist. Wr of a polygon is a sum over pairs of segments: Klenin &
Langowski 2000, "Computation of writhe in modeling of supercoiled DNA", Biopolymers 54, 307-317, method 1a.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from types import ModuleType
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.hard_case import Case, Check
from protocol.kinds import Model
from protocol.messages import Problem, Shape

from .answers import found
from .balance import balance
from .posing import ALONG_X, GRAVITY, WEIGHTLESS, cable, going_on, grasps, span

FAMILY: Final = "twist"
TURNS: Final = (1, 2, 3, 4, 5, 6, 7, 8, 9)
KEPT: Final = {0.6: 3, 0.9: 7, 0.98: 9, 0.999: 9}  # turns with which a shape is found, at some distances of the ends; more are refused


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for turns in TURNS:
        for chord in (0.6, 0.9, 0.98, 0.999):
            name = f"{turns} turns, ends at {chord:g} of the length"
            yield Case(name, FAMILY, partial(_turned, turns, chord), may_decline=turns > KEPT[chord])
        yield Case(f"{-turns} turns are the mirror image of {turns}", FAMILY, partial(_mirrored, turns), may_decline=turns > KEPT[0.98])
    yield Case("12 turns, ends at 0.8 of the length", FAMILY, partial(_turned, 12, 0.8), may_decline=True)
    yield Case("20 turns, ends at 0.8 of the length", FAMILY, partial(_turned, 20, 0.8), may_decline=True)
    for turns in (1, 3, 9):
        yield Case(f"{turns} turns on a straight cable that is pulled", FAMILY, partial(_pulled, turns))
    for turned in (0.5, 1.0, -1.0, -3.0):
        yield Case(f"an end turned by {turned:g} turns in steps of 15 degrees", FAMILY, partial(_in_steps, turned))


def _turned(turns: int, chord: float, path: ModuleType) -> Iterable[Check]:
    problem = Problem(cable=cable(twist=5e-3), grasps=span(chord), turns=(turns,), model=Model.ROD)
    shape = found(problem, GRAVITY, path)
    link = linking(shape)
    yield Check("linking number from a whole one", _whole(link), 1e-2, "turns")
    yield Check("turns lost", abs(round(link) - turns), 0.5, "turns")
    torque = float(shape.grasp_wrenches[1, 3])
    scale = float(np.linalg.norm(shape.grasp_wrenches[1, 3:]))
    yield Check("torque against twist", abs(torque - 5e-3 * shape.total_twist) / scale, 3e-2, "of the moment")
    # Frames combined from two meshes are more exact than the balance of either, whose error is the square of the twist at a node over 48.
    yield from balance(problem, shape, GRAVITY, within=2e-2)


def _mirrored(turns: int, path: ModuleType) -> Iterable[Check]:
    shapes = [
        found(Problem(cable=cable(twist=5e-3), grasps=span(0.98), turns=(sign * turns,), model=Model.ROD), GRAVITY, path)
        for sign in (1, -1)
    ]
    yield Check("difference in energy", abs(shapes[0].energy - shapes[1].energy) / abs(shapes[0].energy), 1e-3, "of it")
    yield Check("sum of the twists", abs(shapes[0].total_twist + shapes[1].total_twist), 1e-2, "rad")


def _pulled(turns: int, path: ModuleType) -> Iterable[Check]:
    """A cable of EA = 1e5 N pulled by 1 % stays straight: 4 EI T > (GJ twist / L)^2, Greenhill 1883."""
    rod = replace(cable(twist=5e-3, mass=0.0), stretch=1e5)
    shape = found(Problem(cable=rod, grasps=span(1.01), turns=(turns,), model=Model.ROD), WEIGHTLESS, path)
    yield Check("total twist", abs(shape.total_twist - 2 * np.pi * turns), 1e-6, "rad")
    yield Check("distance from the chord", float(np.abs(shape.nodes[:, 1:]).max()), 1e-6)
    # The straight line needs no fine mesh for its places, and a turn per segment gives the torque to second order only.
    yield Check("torque", abs(float(shape.grasp_wrenches[1, 3]) / (5e-3 * 2 * np.pi * turns) - 1), 3e-2, "of it")


def _in_steps(turns: float, path: ModuleType) -> Iterable[Check]:
    """Each step is an equilibrium of its own; what the turned end has put in is all there."""
    steps = round(24 * abs(turns))
    shape = found(Problem(cable=cable(twist=5e-3), grasps=span(0.98), model=Model.ROD), GRAVITY, path)
    for k in range(1, steps + 1):
        angle = 2 * np.pi * turns * k / steps
        last = (Rotation.from_quat(ALONG_X) * Rotation.from_rotvec([0.0, 0.0, angle])).as_quat()
        held = grasps((0.0, (0, 0, 0), ALONG_X), (1.0, (0.98, 0, 0), last))
        problem = going_on(Problem(cable=cable(twist=5e-3), grasps=held, model=Model.ROD), shape)
        shape = found(problem, GRAVITY, path)
    yield Check("linking number", _whole(0.5 * (linking(shape, last) - turns)), 1e-2, "turns")
    yield from balance(problem, shape, GRAVITY, within=5e-3)


def _whole(turns: float) -> float:
    """Distance from the nearest whole number."""
    return abs(turns - round(turns))


def linking(shape: Shape, last: np.ndarray = ALONG_X) -> float:
    """Turns of a cable along x, clamped with the frame `last` at its end, closed by a wide detour in the plane x-z."""
    a, b = shape.nodes[0], shape.nodes[-1]
    far = 40.0 * float(shape.s[-1])
    angle = np.linspace(0.0, np.pi, 61)
    middle, half = (a[0] + b[0]) / 2, far + (b[0] - a[0]) / 2
    round_ = np.column_stack([middle + half * np.cos(angle), np.full(61, a[1]), a[2] + half * np.sin(angle)])
    polygon = np.vstack([shape.nodes, round_])
    return writhe(polygon) + twist(shape, last) / (2 * np.pi)


def twist(shape: Shape, last: np.ndarray) -> float:
    """[rad] Turn of the frames about the tangent beyond parallel transport, from the first segment to the last, and to both clamps."""
    held = Rotation.from_quat(np.vstack([ALONG_X, shape.frames, last]))
    tangents = held.apply([0.0, 0.0, 1.0])
    firsts = held.apply([1.0, 0.0, 0.0])
    total = 0.0
    for k in range(len(tangents) - 1):
        axis = np.cross(tangents[k], tangents[k + 1])
        carried = firsts[k] + np.cross(axis, firsts[k]) + np.cross(axis, np.cross(axis, firsts[k])) / (1 + tangents[k] @ tangents[k + 1])
        total += float(np.arctan2(np.cross(carried, firsts[k + 1]) @ tangents[k + 1], carried @ firsts[k + 1]))
    return total


def writhe(polygon: np.ndarray) -> float:
    """Turns; Wr = 1 / 2 pi sum over pairs of segments of the signed area under which one is seen from the other."""
    begin, end = polygon, np.roll(polygon, -1, axis=0)
    i, j = np.triu_indices(len(polygon), 2)
    near = (i == 0) & (j == len(polygon) - 1)
    i, j = i[~near], j[~near]
    r13, r14, r23, r24 = begin[j] - begin[i], end[j] - begin[i], begin[j] - end[i], end[j] - end[i]
    normals = [np.cross(r13, r14), np.cross(r14, r24), np.cross(r24, r23), np.cross(r23, r13)]
    units = [normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300) for normal in normals]
    area = sum(np.arcsin(np.clip(np.einsum("ij,ij->i", units[k], units[(k + 1) % 4]), -1, 1)) for k in range(4))
    sign = np.sign(np.einsum("ij,ij->i", np.cross(end[j] - begin[j], end[i] - begin[i]), r13))
    return float((area * sign).sum() / (2 * np.pi))
