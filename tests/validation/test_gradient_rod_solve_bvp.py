"""The rod with a micro-structure length, in space and with large turns, against `scipy.integrate.solve_bvp` with seventeen states.

Sources: Papargyri-Beskou, Tsepoura, Polyzos and Beskos 2003, "Bending and stability analysis of gradient elastic beams", Int. J. Solids
Struct. 40, 385-400 (energy and boundary terms); Kierzenka & Shampine 2001, ACM Transactions on Mathematical Software 27, 299-316
(algorithm of solve_bvp).

Claim: clamped at both ends or hinged at one, in a plane and in space, round or not, naturally straight or not, with l from a fiftieth of
the length to the length itself, the solver finds positions, frames, forces, moments, curvature and energy with second order, and states
its error. Two meshes combine to fourth order in a plane; to about third where a flat rod twists beside a clamp.
The reference keeps an integral and obeys Castigliano's theorem, neither of which it uses.
solve_bvp is handed a rough guess made from the answer, which tells it the branch and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from gradient_rod import Exact, Law, solved
from posed import G, cable, frame, grasps
from scipy.spatial.transform import Rotation

from protocol.kinds import Hold, Model, Outcome
from protocol.messages import Grasps, Problem, Shape, Start
from protocol.scene import Cable
from shape_server import kernels, solve

MESHES = (50, 100, 200)
ORIGIN = np.zeros(3)
GRAVITY = (0.0, 0.0, -G)
LEVEL = ((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
SKEW = ((0.8, 0.5, 0.2), (0.3, -0.6, 0.5))


@dataclass(frozen=True)
class Case:
    """One metre of rod that weighs 1 N, from the origin."""

    law: Law
    end: tuple[float, float, float]  # m
    tangents: tuple[tuple[float, float, float], tuple[float, float, float]]
    roll: float = 0.0  # rad, of the far frame about its tangent
    hold: Hold = Hold.CLAMP  # of the far end

    def cable(self) -> Cable:
        first, second = self.law.bending
        plain = cable(weight=self.law.weight, bending=first, twist=self.law.twist)
        return replace(plain, bending_2=second, micro_length=self.law.micro, natural_curvature=(*self.law.natural, 0.0))

    def frames(self) -> tuple[np.ndarray, np.ndarray]:
        return frame(self.tangents[0]), frame(self.tangents[1], self.roll)

    def held(self) -> Grasps:
        first, last = self.frames()
        return grasps((0.0, ORIGIN, first, Hold.CLAMP), (1.0, self.end, last, self.hold))

    def problem(self, start: Start | None = None) -> Problem:
        return Problem(cable=self.cable(), grasps=self.held(), start=start, model=Model.ROD)


ROUND, FLAT = (0.01, 0.01), (0.01, 0.03)
CASES = {
    "plane, l = 0.02": Case(Law(ROUND, 0.01, 0.02), (0.7, 0.0, 0.1), LEVEL),
    "plane, l = 0.1": Case(Law(ROUND, 0.01, 0.1), (0.5, 0.0, 0.1), LEVEL),
    "buckled out of its plane, l = 1": Case(Law(ROUND, 0.01, 1.0), (0.7, 0.0, 0.1), LEVEL),
    "plane, hinged": Case(Law(ROUND, 0.01, 0.1), (0.6, 0.0, 0.1), LEVEL, hold=Hold.HINGE),
    "plane, hinged, bent by nature": Case(Law(ROUND, 0.01, 0.05, natural=(0.0, -3.0)), (0.6, 0.0, 0.1), LEVEL, hold=Hold.HINGE),
    "space, flat section": Case(Law(FLAT, 0.012, 0.05), (0.6, 0.2, 0.1), SKEW, 1.0),
    "space, round, turned by 3": Case(Law(ROUND, 0.02, 0.1), (0.6, 0.2, 0.1), SKEW, 3.0),
    "space, flat, hinged": Case(Law(FLAT, 0.012, 0.1, natural=(1.0, 0.5)), (0.6, 0.2, 0.1), SKEW, hold=Hold.HINGE),
}
each_case = pytest.mark.parametrize("name", CASES)


@cache
def cold(name: str) -> Shape:
    return solve(CASES[name].problem(), GRAVITY, tolerance=1e-4, extrapolate=False, path=kernels)


def rough(shape: Shape, first: np.ndarray, natural: tuple[float, float]) -> Callable[[np.ndarray], np.ndarray]:
    """States to start `solve_bvp` from: the answer, interpolated, without double moments."""
    middle = (shape.s[1:] + shape.s[:-1]) / 2
    frames = shape.frames * np.sign(shape.frames[0] @ first)
    flips = np.cumprod(np.append(1.0, np.sign((frames[1:] * frames[:-1]).sum(1))))[:, None]
    turns = (Rotation.from_quat(frames[:-1]).inv() * Rotation.from_quat(frames[1:])).as_rotvec()[:, :2] / np.diff(middle)[:, None]

    def guess(s: np.ndarray) -> np.ndarray:
        position = np.array([np.interp(s, shape.s, row) for row in shape.nodes.T])
        turn = np.array([np.interp(s, middle, row) for row in (frames * flips).T])
        force = -shape.grasp_wrenches[0, :3, None] + np.outer((0.0, 0.0, 1.0), s)
        moment = -shape.grasp_wrenches[0, 3:, None] - np.cross(position, force, axis=0)
        bent = np.array([np.interp(s, shape.s[1:-1], row) for row in (turns - natural).T])
        return np.vstack([position, turn, force, moment, bent, np.zeros_like(bent)])

    return guess


@cache
def reference(name: str) -> Exact:
    case, shape = CASES[name], cold(name)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    return displaced(case, rough(shape, case.frames()[0], case.law.natural), 0.0)


def displaced(case: Case, guess: Callable[[np.ndarray], np.ndarray], aside: float) -> Exact:
    """The reference with its end moved along x."""
    first, last = case.frames()
    end = (np.array(case.end) + np.array([aside, 0.0, 0.0]), last if case.hold is Hold.CLAMP else None)
    return solved(case.law, (ORIGIN, first), end, guess, np.linspace(0.0, 1.0, 201))


def on_mesh(name: str, segments: int, *, extrapolate: bool = False) -> Shape:
    exact, s = reference(name), np.linspace(0.0, 1.0, segments + 1)
    start = Start(s=s, frames=exact.frames((s[1:] + s[:-1]) / 2), grasp_forces=exact.wrenches()[:, :3].copy())
    shape = solve(CASES[name].problem(start), GRAVITY, tolerance=1e-12, extrapolate=extrapolate, path=kernels)
    assert shape.outcome is Outcome.CONVERGED
    assert shape.is_stable
    return shape


def position_error(shape: Shape, exact: Exact) -> float:
    return float(np.linalg.norm(shape.nodes - exact.positions(shape.s), axis=1).max())


def frame_error(shape: Shape, exact: Exact) -> float:
    middle = (shape.s[1:] + shape.s[:-1]) / 2
    return float((Rotation.from_quat(exact.frames(middle)).inv() * Rotation.from_quat(shape.frames)).magnitude().max())


@pytest.mark.sampled(3)
@each_case
def test_the_reference_keeps_its_integral(name: str) -> None:
    assert np.ptp(reference(name).densities(np.linspace(0.0, 1.0, 57))[1]) < 1e-9  # N; measured 3e-12 to 2e-11


@pytest.mark.parametrize("name", ["plane, l = 0.1", "space, flat section", "space, flat, hinged"])
def test_the_reference_obeys_castigliano(name: str) -> None:
    """The force at the far end is the derivative of the energy by its place."""
    exact, step = reference(name), 1e-4
    lower, upper = (displaced(CASES[name], exact.state, size).energy() for size in (-step, step))
    assert (upper - lower) / (2 * step) == pytest.approx(exact.wrenches()[1, 0], abs=1e-6)


@each_case
def test_a_cold_start_finds_the_reference_within_the_tolerance(name: str) -> None:
    shape, exact = cold(name), reference(name)
    assert position_error(shape, exact) < 1e-4  # m; measured 2.4e-5 to 6.6e-5
    assert shape.is_stable
    assert "micro_length" in shape.effects


@each_case
def test_everything_converges_with_order_two(name: str) -> None:
    exact = reference(name)
    shapes = [on_mesh(name, segments) for segments in MESHES]
    errors = np.array(
        [
            [
                position_error(shape, exact),
                frame_error(shape, exact),
                *np.abs(shape.grasp_wrenches - exact.wrenches()).reshape(2, 2, 3).max((0, 2)),
                np.abs(shape.curvature - exact.curvature(shape.s)).max(),
                abs(shape.energy - exact.energy()),
            ]
            for shape in shapes
        ]
    )  # (meshes, 6)
    orders = np.log2(errors[:-1] / errors[1:])
    assert orders[-1] == pytest.approx(2.0, abs=0.1), orders  # measured 1.95 (frames of the flat hinged rod) to 2.03


@each_case
def test_two_meshes_combine_to_fourth_order_in_a_plane(name: str) -> None:
    exact = reference(name)
    coarse, fine = (position_error(on_mesh(name, segments, extrapolate=True), exact) for segments in (192, 384))
    order = np.log2(coarse / fine)
    if name.startswith("plane"):
        assert order == pytest.approx(4.0, abs=0.1)  # measured 3.92 (l = 0.02) to 4.00
    else:
        assert 2.6 < order < 4.1  # measured 2.75 and 3.18 (flat, with half the error of decision 0014) to 4.00 (round)
    assert fine < 3e-8  # m; measured 2e-9 to 2.4e-8


@each_case
def test_the_error_estimate_is_true(name: str) -> None:
    for segments in MESHES:
        shape = on_mesh(name, segments)
        assert shape.error is not None
        # measured 1.30 to 1.35, and 1.81 with l = 1 on 50 segments, where the coarser mesh is not settled to the end
        assert 1.1 < shape.error / position_error(shape, reference(name)) < 2.0  # the factor of safety is 1.3
