"""Figs. 10 and 11 of the paper: through the three real programs, and against the energy and the moment of single shapes."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from taken import said

from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps, Problem
from scenarios import load
from shape_server import solve

ANGLES = (-20.0, 0.0, 4.0, 5.0, 20.0)  # degrees


@pytest.mark.slow
def test_an_inclination_is_fixed_at_zero_or_free_and_free_takes_less_cable() -> None:
    assert said("11")


def test_the_free_inclination_is_where_the_obstacle_bears_no_moment_and_energy_is_least() -> None:
    scene = load("paper/fig_10_11_inclination")
    cable = scene.cables[0]
    flat = (0.5, 0.5, 0.5, 0.5)
    energies, moments = [], []
    for angle in ANGLES:
        half = -0.5 * np.radians(angle)
        turned = _times((0.0, float(np.sin(half)), 0.0, float(np.cos(half))), flat)
        held = Grasps(
            s=np.array([0.0, 3.6, cable.length]),
            position=np.array([[0.0, 0.0, 0.0], [3.5, 0.0, -0.4], [5.0, 0.0, 0.0]]),
            quaternion=np.array([flat, turned, flat]),
            hold=(Hold.CLAMP,) * 3,
        )
        shape = solve(Problem(cable=cable, grasps=held), scene.gravity, tolerance=1e-4)
        assert shape.outcome is Outcome.CONVERGED, shape.sentence
        energies.append(shape.energy)
        moments.append(float(shape.grasp_wrenches[1, 4]))
    free = solve(
        Problem(cable=cable, grasps=msgspec.structs.replace(held, hold=(Hold.CLAMP, Hold.HINGE, Hold.CLAMP))), scene.gravity, tolerance=1e-4
    )
    assert moments[2] * moments[3] < 0.0  # it changes its sign between 4 and 5 degrees
    assert free.energy < min(energies)
    assert energies[0] > energies[1] > energies[2] < energies[4]


def _times(second: tuple[float, ...], first: tuple[float, ...]) -> tuple[float, float, float, float]:
    (a, b, c, d), (x, y, z, w) = second, first
    return (d * x + a * w + b * z - c * y, d * y - a * z + b * w + c * x, d * z + a * y - b * x + c * w, d * w - a * x - b * y - c * z)
