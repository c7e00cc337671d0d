"""What half cells at clamps lack: its slope and moments by differences, and its size against the exact energy of a free rod."""

from __future__ import annotations

import numpy as np
import pytest
from rods import GRAVITY, cable, span
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from protocol.kinds import Hold
from protocol.messages import Grasps, Problem
from shape_server import effects, numpy_path
from shape_server.mesh import even, stops
from shape_server.rod import Rod, State
from shape_server.task import Task

LAW = np.array([2.0, 3.0, 0.7])  # N m^2
NATURAL = np.array([0.3, -0.2, 0.5])  # 1/m
STEP = 1e-6  # rad


def bent() -> tuple[Rod, State]:
    """A rod between a clamp and a clamp inside, with a natural curvature, in frames that no equilibrium has."""
    grasps = span(0.6)
    held = Grasps(s=np.array([0.0, 0.6]), position=grasps.position, quaternion=grasps.quaternion, hold=(Hold.CLAMP, Hold.CLAMP))
    problem = Problem(cable=cable(bending=LAW[0], twist=LAW[2]), grasps=held)
    task = Task(
        problem, GRAVITY, 1e-3, None, True, False, effects.asked_for(problem, GRAVITY), numpy_path, lambda iteration, residual: None
    )
    system = task.system(even(stops(problem), held.s, 10))
    elastic = system.rod.elastic
    rod = system.rod._replace(
        elastic=elastic._replace(law=np.tile(LAW, (len(elastic.law), 1)), bent=np.tile(NATURAL, (len(elastic.law), 1)))
    )
    turns = Rotation.from_rotvec(np.random.default_rng(1).normal(scale=0.1, size=(len(rod.lengths), 3)))
    return rod, system.start((Rotation.from_quat(rod.clamp_frames[0]) * turns).as_quat())


def test_the_slope_is_that_of_the_energy() -> None:
    rod, state = bent()
    slope, _, _ = numpy_path.lacking(rod, state)
    assert np.abs(slope).max() > 1e-4
    for segment in range(len(rod.lengths)):
        for axis in range(3):
            turn = np.zeros((len(rod.lengths), 3))
            turn[segment, axis] = STEP
            energies = [
                numpy_path.lacking(rod, state._replace(frames=numpy_path.retract(state.frames, sign * turn)))[2] for sign in (1, -1)
            ]
            assert slope[segment, axis] == pytest.approx((energies[0] - energies[1]) / (2 * STEP), rel=1e-6, abs=1e-9)


def test_moments_are_what_a_turn_of_the_clamp_costs() -> None:
    rod, state = bent()
    _, moments, _ = numpy_path.lacking(rod, state)
    axes = Rotation.from_quat(rod.clamp_frames)
    for clamp in range(2):
        for axis in range(3):
            turn = np.zeros((2, 3))
            turn[clamp] = axes[clamp].inv().apply(STEP * np.eye(3)[axis])
            turned = [rod._replace(clamp_frames=numpy_path.retract(rod.clamp_frames, sign * turn)) for sign in (1, -1)]
            energies = [numpy_path.lacking(one, state)[2] for one in turned]
            assert moments[clamp, axis] == pytest.approx((energies[0] - energies[1]) / (2 * STEP), rel=1e-6, abs=1e-9)


def least_energy(length: float, turn: np.ndarray) -> float:
    """[J] Of a rod without forces on it whose ends are turned against each other: marched, and shot at the turn."""

    def marched(first: np.ndarray) -> np.ndarray:
        def rhs(_: float, y: np.ndarray) -> np.ndarray:
            kappa, (x, z, w, r) = y[:3], y[3:7]
            moment = LAW * (kappa - NATURAL)
            rate = -np.cross(kappa, moment) / LAW
            a, b, c = kappa
            spin = 0.5 * np.array([r * a + z * c - w * b, r * b + w * a - x * c, r * c + x * b - z * a, -(x * a + z * b + w * c)])
            return np.concatenate([rate, spin, [0.5 * moment @ (kappa - NATURAL)]])

        start = np.concatenate([first, [0.0, 0.0, 0.0, 1.0, 0.0]])
        return solve_ivp(rhs, (0.0, length), start, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]

    found = root(lambda first: Rotation.from_quat(marched(first)[3:7]).as_rotvec() - turn, turn / length, tol=1e-14)
    assert np.abs(found.fun).max() < 1e-13
    return float(marched(found.x)[7])


def test_a_mean_curvature_stores_more_than_a_free_rod_by_the_stated_term() -> None:
    kappa = np.array([1.1, -0.6, 0.8])
    across = np.cross(kappa, LAW * (kappa - NATURAL))
    stated = across @ (across / LAW) / 24
    for length, most in ((0.4, 2e-2), (0.2, 5e-3), (0.1, 1.5e-3)):
        mean = 0.5 * length * (LAW * (kappa - NATURAL) ** 2).sum()
        found = (mean - least_energy(length, length * kappa)) / length**3
        assert found == pytest.approx(stated, rel=most)
