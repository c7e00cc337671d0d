"""The standard set: ten static problems of which the exact shape is known, each hard in its own way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.cable import Cable
from protocol.kinds import Hold
from protocol.messages import Grasps, Problem, Shape
from protocol.scene import Vector

from . import boundary_value, floor
from .draws import GRAVITY, LEVEL, Exact, Points, lying_on_floor
from .hanging import hanging

WEIGHT: Final = 1.0  # N/m
G: Final = 9.81  # m/s^2


@dataclass(frozen=True)
class Static:
    """A problem, and how to find the exact points at given arc lengths from a shape of the branch meant."""

    name: str
    title: str
    problem: Problem
    gravity: Vector
    exact: Exact


def standard() -> tuple[Static, ...]:
    """All ten."""
    return (
        _rod("slack", "slack between level clamps, EI = 0.003 w L^3", 3e-3, (0.6, 0.0, 0.0)),
        _rod("stiff", "stiff between level clamps, EI = w L^3", 1.0, (0.6, 0.0, 0.0)),
        _rod("soft", "soft between level clamps, EI = 1e-5 w L^3: layers of 4 mm", 1e-5, (0.6, 0.0, 0.0)),
        _rod("nearly taut", "nearly taut, 0.1 % of slack", 3e-3, (0.999, 0.0, 0.0)),
        _rod("hinged", "clamped at one end, hinged at the other", 1e-2, (0.5, 0.0, 0.2), hold=(Hold.CLAMP, Hold.HINGE)),
        _rod("twisted", "ends turned by 40 degrees and twisted by 180", 3e-3, (0.6, 0.0, 0.0), yaw=40.0, roll=180.0),
        _rod(
            "flat and bent",
            "bent when free, three times as stiff one way",
            1e-2,
            (0.55, 0.2, 0.1),
            bending_2=3e-2,
            bent=(2.0, 0.0, 1.0),
        ),
        _rod("stretching", "stretched by up to a hundredth", 3e-3, (0.8, 0.0, 0.0), stretch=60.0),
        _catenary(),
        _on_floor(),
    )


def _rod(
    name: str,
    title: str,
    bending: float,
    end: tuple[float, float, float],
    *,
    yaw: float = 0.0,
    roll: float = 0.0,
    hold: tuple[Hold, Hold] = (Hold.CLAMP, Hold.CLAMP),
    bending_2: float | None = None,
    bent: Vector | None = None,
    stretch: float | None = None,
) -> Static:
    """A rod of 1 m that weighs 1 N, from the origin."""
    cable = Cable(
        name=name,
        length=1.0,
        diameter=2e-3,
        mass_per_length=WEIGHT / G,
        bending=bending,
        twist=0.8 * bending,
        bending_2=bending_2,
        natural_curvature=bent,
        stretch=stretch,
    )
    far = Rotation.from_euler("z", yaw, degrees=True) * LEVEL * Rotation.from_euler("z", roll, degrees=True)
    held = Grasps(
        s=np.array([0.0, 1.0]), position=np.array([np.zeros(3), end]), quaternion=np.array([LEVEL.as_quat(), far.as_quat()]), hold=hold
    )
    problem = Problem(cable=cable, grasps=held)

    def exact(shape: Shape) -> Points | None:
        found = boundary_value.reference(problem, GRAVITY, shape)
        return None if found is None else found.nodes

    return Static(name, title, problem, GRAVITY, exact)


def _catenary() -> Static:
    """The cable of the paper's case study I: twelve units between ends five apart, without bending."""
    cable = Cable(name="hanging", length=12.0, diameter=0.02, mass_per_length=WEIGHT / G)
    place = np.array([5.0, 0.0, 0.0])
    held = Grasps(
        s=np.array([0.0, 12.0]),
        position=np.array([np.zeros(3), place]),
        quaternion=np.array([LEVEL.as_quat()] * 2),
        hold=(Hold.HINGE, Hold.HINGE),
    )

    def exact(_shape: Shape) -> Points:
        return lambda s: hanging(np.zeros(3), place, 12.0, s)

    return Static("no bending", "12 m without bending between points 5 m apart", Problem(cable=cable, grasps=held), GRAVITY, exact)


def _on_floor() -> Static:
    problem, ends, height = lying_on_floor(1.0, WEIGHT, 1e-3, np.array([0.02, 0.02]), 0.7)

    def exact(shape: Shape) -> Points | None:
        found = floor.lying(1e-3, WEIGHT, 1.0, ends, height, shape)
        return None if found is None else found.nodes

    return Static("on a floor", "lying on a floor between clamps 2 cm above it", problem, GRAVITY, exact)
