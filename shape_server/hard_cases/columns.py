"""Columns, masts and rings at the loads where they give way: Euler, Greenhill, Michell and Zajac, a thousandth below and above.

Euler 1759: a straight column of 1 m with EI = 1 N m^2 gives way at pi^2 / 4 (free top), pi^2 (hinges), 20.19 (clamp and hinge) and
4 pi^2 (clamps, also with a top that slides) newtons. Greenhill 1881: under its own weight at w L^3 / EI = 7.8373. Michell 1889, Zajac
1962: a ring leaves its plane when twisted by 2 pi sqrt(3) EI / GJ. Love 1944, secs. 262-263: how far a pressed rod bows.
Below the load the straight shape must be kept; above it, never be called stable.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from types import ModuleType
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from protocol.hard_case import Case, Check
from protocol.kinds import Hold, Model
from protocol.messages import Grasps, PointLoads, Problem, Start
from protocol.scene import Vector

from .answers import found
from .balance import balance
from .posing import ALONG_X, UP, WEIGHTLESS, cable, frame, grasps, span, straight
from .references import elastica_amplitude, elastica_modulus, elastica_thrust, greenhill

FAMILY: Final = "columns and rings"
STRETCH: Final = 1e6  # N, of a column that is pressed between fixed ends; shifts the load by 4e-5 of it
FAINT: Final[Vector] = (0.0, 0.0, -1e-4)  # m/s^2, on a ring of 1 kg: 1e-4 of EI / L^2, so that it does not swing about its clamp
BELOW: Final = (0.5, 0.95, 0.99, 0.998)
ABOVE: Final = (1.003, 1.01, 1.1, 1.5)


@dataclass(frozen=True)
class Ends:
    """How a column is held, and the force [N] at which it gives way."""

    hold: tuple[Hold, ...]
    critical: float


COLUMNS: Final = {
    "free top": Ends((Hold.CLAMP,), np.pi**2 / 4),
    "guided top": Ends((Hold.CLAMP, Hold.GUIDE), 4 * np.pi**2),
    "clamps": Ends((Hold.CLAMP, Hold.CLAMP), 4 * np.pi**2),
    "clamp and hinge": Ends((Hold.CLAMP, Hold.HINGE), float(brentq(lambda x: np.tan(x) - x, 4.3, 4.6, xtol=1e-14)) ** 2),
    "hinges": Ends((Hold.HINGE, Hold.HINGE), np.pi**2),
}


def cases() -> Iterator[Case]:
    """All cases of the family."""
    for name, ends in COLUMNS.items():
        for part in (*BELOW, *ABOVE):
            yield Case(f"column, {name}, at {part:g} of Euler's load", FAMILY, partial(_column, ends, part))
    for part in (0.5, 0.9, 0.98, 0.995, 1.005, 1.02, 1.1, 1.5):
        yield Case(f"mast at {part:g} of Greenhill's height", FAMILY, partial(_mast, part, True))
    for part in (0.5, 0.9, 1.1, 1.5, 3.0):
        yield Case(f"mast at {part:g} of Greenhill's height, cold", FAMILY, partial(_mast, part, False))
    for twist in (1.0, 2.0, 4.0):
        for part in (0.5, 0.9, 0.99, 0.998, 1.002, 1.01, 1.1):
            snaps = part > 1.005 or (part > 1 and twist > 1)  # through itself, to a figure of eight
            yield Case(f"ring, GJ/EI {twist:g}, at {part:g} of Michell's twist", FAMILY, partial(_ring, twist, part), may_decline=snaps)
    for chord in (0.9999, 0.99, 0.9, 0.7, 0.5):
        yield Case(f"elastica, ends at {chord:g} of the length", FAMILY, partial(_elastica, chord))
    for chord in (0.99, 0.9, 0.7):
        yield Case(f"two waves, ends at {chord:g} of the length", FAMILY, partial(_two_waves, chord))


def _kept(problem: Problem, gravity: Vector, path: ModuleType, *, must_hold: bool, aside: float) -> Iterable[Check]:
    """Below the load: on the line through the start. Above it: elsewhere, or declined as not stable."""
    line = Rotation.from_quat(problem.grasps.quaternion[0]).apply([0.0, 0.0, 1.0])
    shape = found(problem, gravity, path, extrapolate=False, margin=True)
    off = float(np.linalg.norm(np.cross(shape.nodes - problem.grasps.position[0], line), axis=1).max())
    if must_hold:
        yield Check("distance from the straight shape", off, aside)
    else:
        yield Check("straightness of a shape that gives way", aside / max(off, 1e-300), 1.0, "of what is left of it")


def _column(ends: Ends, part: float, path: ModuleType) -> Iterable[Check]:
    """Pressed by a dead load where the top can move, else by ends that are nearer to each other."""
    rod, force = cable(bending=1.0, twist=50.0, mass=0.0), part * ends.critical
    rows = [(0.0, (0.0, 0.0, 0.0), ALONG_X)]
    push: list[Vector] = [(force, 0.0, 0.0)]
    loads = None
    is_free = len(ends.hold) == 1 or ends.hold[1] is Hold.GUIDE
    if is_free:
        loads = PointLoads(s=np.array([1.0]), force=np.array([[-force, 0.0, 0.0]]))
    else:
        rod = replace(rod, stretch=STRETCH)
    if len(ends.hold) == 2:
        rows.append((1.0, (1.0 if is_free else 1.0 - force / STRETCH, 0.0, 0.0), ALONG_X))
        push.append((0.0 if is_free else -force, 0.0, 0.0))
    held = grasps(*rows)
    problem = Problem(
        cable=rod,
        grasps=Grasps(s=held.s, position=held.position, quaternion=held.quaternion, hold=ends.hold),
        loads=loads,
        start=straight(ALONG_X, 200, push),
        model=Model.ROD,
    )
    return _kept(problem, WEIGHTLESS, path, must_hold=part < 1, aside=1e-6)


def _mast(part: float, is_warm: bool, path: ModuleType) -> Iterable[Check]:
    bending = 0.981 / (part * greenhill())
    problem = Problem(
        cable=cable(bending=bending),
        grasps=grasps((0.0, (0.0, 0.0, 0.0), UP)),
        start=straight(UP, 100, [0.0, 0.0, 0.981]) if is_warm else None,
        model=Model.ROD,
    )
    return _kept(problem, (0.0, 0.0, -9.81), path, must_hold=part < 1, aside=1e-3)


def _ring_frame(s: float, angle: float) -> np.ndarray:
    """(4,) Frame of a ring of 1 m that hangs below its clamp, twisted by `angle` [rad] so far."""
    d3 = np.array([np.cos(2 * np.pi * s), 0.0, -np.sin(2 * np.pi * s)])
    d2 = np.array([0.0, -1.0, 0.0])
    turn = Rotation.from_matrix(np.column_stack([np.cross(d2, d3), d2, d3])) * Rotation.from_rotvec([0, 0, angle])
    return np.asarray(turn.as_quat())


def _ring(twist: float, part: float, path: ModuleType) -> Iterable[Check]:
    angle = part * 2 * np.pi * np.sqrt(3) / twist
    s = np.linspace(0.0, 1.0, 201)
    frames = np.array([_ring_frame(at, angle * at) for at in (s[1:] + s[:-1]) / 2])
    square = 2 * np.pi * twist * angle  # N, to the plane; turns the twisting moment along the ring
    forces = np.array([[0.0, -square, 5e-5], [0.0, square, 5e-5]])
    held = grasps((0.0, (0, 0, 0), _ring_frame(0.0, 0.0)), (1.0, (0, 0, 0), _ring_frame(1.0, angle)))
    start = Start(s=s, frames=frames, grasp_forces=forces)
    problem = Problem(cable=cable(bending=1.0, twist=twist, mass=1.0), grasps=held, start=start, model=Model.ROD)
    shape = found(problem, FAINT, path, extrapolate=False)
    aside = float(np.abs(shape.nodes[:, 1]).max())
    untwisted = abs(float(shape.grasp_wrenches[0, 3]) + twist * angle) / (twist * angle)
    if part < 1:
        yield Check("distance from the plane", aside, 2e-3)
        yield Check("twisting moment", untwisted, 0.02, "of it")
    else:
        moved = max(aside / 2e-3, untwisted / 0.02)
        yield Check("planeness of a ring that gives way", 1.0 / max(moved, 1e-300), 1.0, "of what is left of it")


def _wave(chord: float, waves: int) -> Problem:
    """A rod between clamps that starts near the elastica with that many waves."""
    s = np.linspace(0.0, 1.0, 201)
    slope = 2 * np.arcsin(np.sqrt(elastica_modulus(chord)) * np.sin(2 * np.pi * waves * (s[1:] + s[:-1]) / 2))
    frames = np.array([frame((np.cos(a), 0.0, np.sin(a)), (-np.sin(a), 0.0, np.cos(a))) for a in slope])
    force = elastica_thrust(chord) * waves**2
    start = Start(s=s, frames=frames, grasp_forces=np.array([[force, 0.0, 0.0], [-force, 0.0, 0.0]]))
    return Problem(cable=cable(bending=1.0, twist=1.0, mass=0.0), grasps=span(chord), start=start, model=Model.ROD)


def _elastica(chord: float, path: ModuleType) -> Iterable[Check]:
    problem = _wave(chord, 1)
    shape = found(problem, WEIGHTLESS, path, extrapolate=False)
    amplitude = elastica_amplitude(chord)
    bow = float(np.hypot(*shape.nodes[(len(shape.s) - 1) // 2, 1:]))
    yield Check("bow of the middle", abs(bow - amplitude), 1e-4 * amplitude + 1e-6)
    yield Check("thrust", abs(float(shape.grasp_wrenches[0, 0]) / elastica_thrust(chord) - 1), 1e-4, "of it")
    yield from balance(problem, shape, WEIGHTLESS)


def _two_waves(chord: float, path: ModuleType) -> Iterable[Check]:
    """In equilibrium at four times the force, and not stable: the plane start must be left, or declined."""
    shape = found(_wave(chord, 2), WEIGHTLESS, path, extrapolate=False)
    yield Check("thrust of what it settles in", float(np.linalg.norm(shape.grasp_wrenches[0, :3])), 2 * elastica_thrust(chord), "N")
