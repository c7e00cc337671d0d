"""Rods that bend about two axes, are bent before they are loaded, and are twisted: Love 1944.

Source: Love 1944, "A treatise on the mathematical theory of elasticity", 4th ed., secs. 253 to 264 and 270; Kirchhoff 1859, Journal fuer
die reine und angewandte Mathematik 56, 285-313 (helices); Saint-Venant 1855, "De la torsion des prismes", Memoires des
savants etrangers 14.

Claims, with EI_1 about d1 and EI_2 about d2 of the section:
- a small force F at the tip of a cantilever moves it by L^3 / 3 (F.d2 d2 / EI_1 + F.d1 d1 / EI_2), not along the force; large forces
  and weight as in `cantilever`, by shooting;
- a free rod with the natural curvature (k1, k2, k3) is the helix with the spin k in the frame of the section;
- held at both ends on the helix of another spin u, it stays on that helix if the moment B (u - k) is along it: for a circle, with no force;
- a straight rod turned by phi is twisted by the moment GJ phi / L, and all phi of a taut cable is twist, whole turns too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cantilever import Part, cantilever
from loaded import answer, place, pose, unbalanced
from posed import cable, frame, grasps
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps

Spin = tuple[float, float, float]
ALONG = frame((1.0, 0.0, 0.0))
SKEW = frame((1.0, 0.3, 0.2), roll=0.7)
ORIGIN = (0.0, 0.0, 0.0)
STRIP = replace(cable(bending=1.0, twist=0.8, weight=0.0), bending_2=4.0)
ROUND = cable(bending=1.0, twist=0.8, weight=0.0)
SPINS = ((3.0, 0.0, 0.0), (0.0, 3.0, 0.0), (2.0, 1.0, 4.0), (0.0, 12.0, 0.0), (5.0, 0.0, 20.0))


def foot(quaternion: np.ndarray = ALONG) -> Grasps:
    return grasps((0.0, ORIGIN, quaternion, Hold.CLAMP))


def turned(quaternion: np.ndarray, spin: Spin) -> np.ndarray:
    """(4,) The frame turned by the rotation vector `spin` in its own axes."""
    return (Rotation.from_quat(quaternion) * Rotation.from_rotvec(spin)).as_quat()


def helix(spin: Spin, quaternion: np.ndarray, s: np.ndarray) -> np.ndarray:
    """(k, 3) [m] From the origin, with the constant spin [1/m] in the axes of the section."""
    size = np.linalg.norm(spin)
    axis = np.array(spin) / size
    d3 = np.array([0.0, 0.0, 1.0])
    along, across = axis[2] * axis, d3 - axis[2] * axis
    s = np.asarray(s)[:, None]
    own = along * s + across * np.sin(size * s) / size + np.cross(axis, d3) * (1 - np.cos(size * s)) / size
    return Rotation.from_quat(quaternion).apply(own)


def test_a_small_force_at_45_degrees_moves_the_tip_along_the_soft_axis_mostly() -> None:
    force = 1e-3 * np.array([0.0, 1.0, 1.0]) / np.sqrt(2)
    shape = answer(pose(STRIP, foot(), (1.0, tuple(force))), tolerance=1e-9)
    d1, d2, _ = Rotation.from_quat(ALONG).as_matrix().T
    small = (force @ d2) * d2 / 3 + (force @ d1) * d1 / 12
    assert shape.nodes[-1, 1:] == pytest.approx(small[1:], rel=1e-5)
    by_shooting, _ = cantilever((Part(1.0, (1.0, 4.0, 0.8), force=tuple(force)),), ALONG)
    assert by_shooting[-1, 1:] == pytest.approx(small[1:], rel=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("size", [1.0, 5.0, 20.0])
def test_a_large_force_at_45_degrees_bends_and_twists_as_by_shooting(size: float) -> None:
    force = (0.0, size / np.sqrt(2), size / np.sqrt(2))
    problem = pose(STRIP, foot(), (1.0, force))
    shape = answer(problem, tolerance=1e-7)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    tip, moment = cantilever((Part(1.0, (1.0, 4.0, 0.8), force=force),), ALONG, steps=4)
    assert shape.nodes[-1] == pytest.approx(tip[-1], abs=1e-7)  # m; the tolerance asked for
    assert shape.grasp_wrenches[0, 3:] == pytest.approx(-moment, abs=3e-6 * size)  # N m
    assert max(unbalanced(problem, shape)) < 1e-9


@pytest.mark.thorough
@pytest.mark.parametrize("natural", [None, (2.0, 1.0, 4.0), (0.0, 3.0, 0.0)])
def test_a_strip_that_droops_under_its_weight_twists_as_by_shooting(natural: Spin | None) -> None:
    rod = replace(cable(bending=0.1, twist=0.05), bending_2=0.4, natural_curvature=natural)
    problem = pose(rod, foot(SKEW))
    shape = answer(problem, tolerance=1e-7)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    tip, moment = cantilever((Part(1.0, (0.1, 0.4, 0.05), 1.0, natural or (0.0, 0.0, 0.0)),), SKEW, steps=4)
    assert shape.nodes[-1] == pytest.approx(tip[-1], abs=1e-7)  # m; the tolerance asked for
    assert shape.grasp_wrenches[0, 3:] == pytest.approx(-moment, abs=1e-5)  # N m; measured 4.2e-6 at most
    assert max(unbalanced(problem, shape)) < 1e-9


@pytest.mark.parametrize("spin", SPINS)
def test_the_helix_solves_the_equation_of_its_frame(spin: Spin) -> None:
    def rhs(_: float, y: np.ndarray) -> np.ndarray:
        turn = y[3:].reshape(3, 3)
        return np.concatenate([turn[:, 2], np.cross(turn @ np.array(spin), turn, axisb=0, axisc=0).ravel()])

    start = np.concatenate([np.zeros(3), Rotation.from_quat(SKEW).as_matrix().ravel()])
    marched = solve_ivp(rhs, (0.0, 1.0), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:3, -1]
    assert helix(spin, SKEW, np.array([1.0]))[0] == pytest.approx(marched, abs=1e-10)


@pytest.mark.parametrize("strip", [False, True])
@pytest.mark.parametrize("spin", SPINS)
def test_a_free_rod_is_the_helix_of_its_natural_curvature(spin: Spin, strip: bool) -> None:
    rod = replace(STRIP if strip else ROUND, natural_curvature=spin)
    shape = answer(pose(rod, foot(SKEW)), tolerance=1e-6)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert np.linalg.norm(shape.nodes - helix(spin, SKEW, shape.s), axis=1).max() < 1e-6  # m; the tolerance asked for
    assert np.abs(shape.grasp_wrenches).max() < 1e-6  # N and N m


@pytest.mark.parametrize("bent", [1.0, 3.0, 4.0])
def test_a_bent_rod_clamped_on_another_circle_is_held_by_moments_alone(bent: float) -> None:
    natural, end = 2.0, helix((0.0, bent, 0.0), ALONG, np.array([1.0]))[0]
    held = grasps((0.0, ORIGIN, ALONG, Hold.CLAMP), (1.0, end, turned(ALONG, (0.0, bent, 0.0)), Hold.CLAMP))
    shape = answer(pose(replace(ROUND, natural_curvature=(0.0, natural, 0.0)), held), tolerance=1e-7)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert np.linalg.norm(shape.nodes - helix((0.0, bent, 0.0), ALONG, shape.s), axis=1).max() < 1e-7  # m; the tolerance asked for
    d2 = Rotation.from_quat(ALONG).as_matrix()[:, 1]
    assert shape.grasp_wrenches[0, 3:] == pytest.approx(-(bent - natural) * d2, abs=1e-5)  # N m
    assert np.abs(shape.grasp_wrenches[:, :3]).max() < 1e-4  # N
    assert shape.energy == pytest.approx((bent - natural) ** 2 / 2, abs=1e-5)  # J


@pytest.mark.parametrize("strain", [1e-3, 1e-2])
@pytest.mark.parametrize("angle", [0.5, 2.0, -3.0])
def test_a_straight_rod_turned_at_its_end_is_twisted_by_saint_venants_moment(angle: float, strain: float) -> None:
    held = grasps((0.0, ORIGIN, ALONG, Hold.CLAMP), (1.0, (1 + strain, 0.0, 0.0), turned(ALONG, (0.0, 0.0, angle)), Hold.CLAMP))
    shape = answer(pose(replace(ROUND, stretch=1e4), held), tolerance=1e-9)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.total_twist == pytest.approx(angle, abs=1e-9)
    # 48 segments turn by phi / 48 each: measured 8.9e-7 (0.5) to 3.3e-4 (-3.0); theory: (phi / 48)^2 / 12
    assert shape.grasp_wrenches[1, 3] == pytest.approx(0.8 * angle, rel=5e-4)
    assert shape.grasp_wrenches[1, 0] == pytest.approx(1e4 * strain, rel=1e-6)
    assert shape.energy == pytest.approx(1e4 * strain**2 / 2 + 0.8 * angle**2 / 2, rel=5e-4)


@pytest.mark.parametrize("turns", [-3, -1, 1, 3])
def test_a_taut_cable_is_twisted_by_the_turns_asked_for(turns: int) -> None:
    """Its tension, 100 N, keeps it straight: a clamped rod with EI = 1 N m^2 gives way at about 22 N m then."""
    held = grasps((0.0, ORIGIN, ALONG, Hold.CLAMP), (1.0, (1.01, 0.0, 0.0), turned(ALONG, (0.0, 0.0, 0.5)), Hold.CLAMP))
    shape = answer(pose(replace(ROUND, stretch=1e4), held, turns=(turns,)), tolerance=1e-9)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.total_twist == pytest.approx(0.5 + 2 * np.pi * turns, abs=1e-9)
    assert np.abs(shape.nodes[:, 1:]).max() < 1e-9  # m
    assert shape.grasp_wrenches[1, 3] == pytest.approx(0.8 * shape.total_twist, rel=2e-2)  # measured 1.4e-2 at three turns


@pytest.mark.parametrize("turns", [0, 1, 3])
def test_a_heavy_cable_drawn_almost_taut_keeps_the_turns_asked_for(turns: int) -> None:
    held = grasps((0.0, ORIGIN, ALONG, Hold.CLAMP), (1.0, (0.9999, 0.0, 0.0), turned(ALONG, (0.0, 0.0, 1.0)), Hold.CLAMP))
    problem = pose(cable(bending=1e-3, twist=1e-3), held, turns=(turns,))
    shape = answer(problem, tolerance=1e-6)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.total_twist == pytest.approx(1 + 2 * np.pi * turns, rel=1e-5)
    assert place(shape, 0.5)[2] < 0.0
    assert max(unbalanced(problem, shape)) < 1e-9
