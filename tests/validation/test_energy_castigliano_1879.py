"""The energy of a shape changes with the place of an end by the force there: Castigliano 1879.

Source: Castigliano 1879, "Theorie de l'equilibre des systemes elastiques", part I, ch. I; Love 1944, "A treatise on the mathematical theory
of elasticity", 4th ed., sec. 121.

Claim: d(energy) / d(end) is the force of the grasp on the cable, and d(energy) / d(turn of the end) its moment, for bending, stretch,
twist, two axes, natural curvature, sections, masses and point loads alike. The energy and the forces come out of different sums. The
derivative is a central difference over +-h with the tolerance asked for far below h; the difference is checked on a spring.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from loaded import answer, pose
from posed import G, cable, frame, grasps, start_from
from scipy.spatial.transform import Rotation

from protocol.cable import Cable, LumpedMass, Section
from protocol.kinds import Hold, Outcome
from protocol.messages import Problem, Shape, Start

STEP = 1e-3  # m, rad
FIRST, LAST = frame((0.8, 0.5, 0.2)), frame((0.3, -0.6, 0.5), roll=1.0)
END = np.array([0.6, 0.2, 0.1])  # m
PLAIN = cable(bending=0.05, twist=0.03)
RODS: dict[str, Cable] = {
    "bending and twist": PLAIN,
    "stretch": replace(PLAIN, stretch=20.0),
    "two axes": replace(PLAIN, bending_2=0.15),
    "natural curvature": replace(PLAIN, natural_curvature=(1.0, -2.0, 1.5)),
    "sections": replace(PLAIN, sections=(Section(start=0.3, end=0.6, bending=0.2, mass_per_length=0.5),)),
    "masses": replace(PLAIN, masses=(LumpedMass(0.4, 0.5 / G),)),
}
each_rod = pytest.mark.parametrize("name", [*RODS, "point loads"])


def problem(name: str, end: np.ndarray, turn: np.ndarray, start: Start | None) -> Problem:
    last = (Rotation.from_rotvec(turn) * Rotation.from_quat(LAST)).as_quat()
    held = grasps((0.0, (0.0, 0.0, 0.0), FIRST, Hold.CLAMP), (1.0, end, last, Hold.CLAMP))
    return pose(RODS.get(name, PLAIN), held, *([(0.7, (0.2, -0.3, 0.1))] if name == "point loads" else []), start=start)


def shaped(name: str, end: np.ndarray, turn: np.ndarray, start: Start | None = None) -> Shape:
    shape = answer(problem(name, end, turn, start), tolerance=1e-8)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    return shape


def slope(energy: Callable[[float], float]) -> float:
    """Central difference of fourth order."""
    return (8 * (energy(STEP) - energy(-STEP)) - energy(2 * STEP) + energy(-2 * STEP)) / (12 * STEP)


def test_the_theorem_holds_for_a_spring() -> None:
    assert slope(lambda h: 3.0 / 2 * (0.2 + h) ** 2) == pytest.approx(3.0 * 0.2, rel=1e-10)


@pytest.mark.sampled(2)
@each_rod
def test_the_energy_changes_by_the_force_and_the_moment_at_the_end(name: str) -> None:
    here = shaped(name, END, np.zeros(3))
    start = start_from(here)
    near = shaped(name, END, np.zeros(3), start)
    for axis, way in enumerate(np.eye(3)):
        by_place = slope(lambda h, way=way: shaped(name, END + h * way, np.zeros(3), start).energy)
        by_turn = slope(lambda h, way=way: shaped(name, END, h * way, start).energy)
        assert by_place == pytest.approx(near.grasp_wrenches[1, axis], abs=2e-4), ("force", axis)  # N
        assert by_turn == pytest.approx(near.grasp_wrenches[1, 3 + axis], abs=2e-4), ("moment", axis)  # N m
