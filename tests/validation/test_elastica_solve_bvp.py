"""The heavy planar elastica against `scipy.integrate.solve_bvp`.

Source: Kierzenka & Shampine 2001, "A BVP solver based on residual control and the Matlab PSE", ACM Transactions on
Mathematical Software 27, 299-316 (the algorithm of solve_bvp), applied to the planar heavy elastica
EI theta'' = n_x sin(theta) - (n_z + w s) cos(theta); see Wang 1986, "A critical review of the heavy elastica",
International Journal of Mechanical Sciences 28, 549-559.

Claim: clamped or hinged at its far end, for EI/(w L^3) from 1e-1 to 1e-4, the solver finds the shape, the forces and the
moments at the ends with an error of second order in the segment's length, and states that error itself.
The reference is checked by Castigliano's first theorem: its end force is the derivative of its energy by the end's place.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from heavy_elastica import Planar, planar
from posed import ask, cable, frame, grasps, unbalance

from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps, Shape, Start

STIFFNESSES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)  # N m^2, on 1 m of cable that weighs 1 N
MESHES = (50, 100, 200, 400)
END = (0.7, 0.0, 0.1)  # m, place of the far end; the near one is at the origin
LEVEL = frame((1.0, 0.0, 0.0))

each_stiffness = pytest.mark.parametrize("bending", STIFFNESSES)
each_hold = pytest.mark.parametrize("hold", [Hold.CLAMP, Hold.HINGE])


@cache
def reference(bending: float, hold: Hold) -> Planar:
    """Hanging between both ends; followed from the stiffest cable down to this one."""
    stiffer = [b for b in STIFFNESSES if b > bending]
    return solved(bending, hold, END[0], reference(min(stiffer), hold) if stiffer else None)


def solved(bending: float, hold: Hold, x: float, guess: Planar | None) -> Planar:
    return planar(
        bending=bending,
        weight=1.0,
        length=1.0,
        start=(0.0, 0.0, 0.0),
        end=(x, END[2], 0.0 if hold is Hold.CLAMP else None),
        guess=guess,
        slope=lambda s: -1.2 * np.sin(2 * np.pi * s),
        force=(0.15, -0.5),
    )


def held(hold: Hold) -> Grasps:
    return grasps((0.0, (0.0, 0.0, 0.0), LEVEL, Hold.CLAMP), (1.0, END, LEVEL, hold))


def end_forces(exact: Planar) -> np.ndarray:
    """(2, 3) [N] On the cable at both ends."""
    return np.array([[-exact.force[0], 0.0, -exact.force[1]], [exact.force[0], 0.0, exact.force[1] + 1.0]])


def end_moments(exact: Planar) -> np.ndarray:
    """(2, 3) [N m] On the cable at both ends; a rising slope is a turn about -y."""
    curvature = exact.state(np.array([0.0, 1.0]))[3]
    return np.array([[0.0, exact.bending * curvature[0], 0.0], [0.0, -exact.bending * curvature[1], 0.0]])


def on_mesh(bending: float, hold: Hold, segments: int) -> Shape:
    exact = reference(bending, hold)
    s = np.linspace(0.0, 1.0, segments + 1)
    slope = exact.state((s[1:] + s[:-1]) / 2)[2]
    frames = np.array([frame((np.cos(a), 0.0, np.sin(a))) for a in slope])
    start = Start(s=s, frames=frames, grasp_forces=end_forces(exact))
    shape = ask(cable(bending=bending), held(hold), start=start)
    assert shape.outcome is Outcome.CONVERGED
    assert shape.is_stable
    assert len(shape.s) == segments + 1
    return shape


def position_error(shape: Shape, exact: Planar) -> float:
    return float(np.linalg.norm(shape.nodes - exact.positions(shape.s), axis=1).max())


@pytest.mark.sampled(3)
@each_hold
@pytest.mark.parametrize("bending", [1e-1, 1e-2])
def test_the_reference_obeys_castigliano(bending: float, hold: Hold) -> None:
    exact, step = reference(bending, hold), 1e-4
    lower, upper = (solved(bending, hold, END[0] + d, exact).energy() for d in (-step, step))
    # measured 8e-10 to 4e-9 N; central difference, second order in the step
    assert (upper - lower) / (2 * step) == pytest.approx(exact.force[0], abs=1e-6, rel=1e-7)


@pytest.mark.sampled(3)
@each_stiffness
def test_a_clamped_cable_hangs_as_the_reference(bending: float) -> None:
    exact = reference(bending, Hold.CLAMP)
    shape = ask(cable(bending=bending), held(Hold.CLAMP), tolerance=1e-4)
    assert shape.outcome is Outcome.CONVERGED
    assert shape.is_stable
    assert position_error(shape, exact) < 1e-4  # measured 3.0e-5 to 9.5e-5 m; what was asked for
    moments = shape.grasp_wrenches[:, 3:] - end_moments(exact)
    assert np.abs(shape.grasp_wrenches[:, :3] - end_forces(exact)).max() < 2e-4  # N; measured 1.1e-4, of weight 1 N
    assert np.abs(moments).max() < 2e-4  # N m; measured 1.3e-4 at EI = 0.1, where the moment is 0.8


@pytest.mark.sampled(2)
@each_stiffness
def test_a_cable_hinged_at_its_far_end_hangs_as_the_reference(bending: float) -> None:
    """From a cold start, as when no shape is known."""
    shape = ask(cable(bending=bending), held(Hold.HINGE), tolerance=1e-4)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.is_stable
    assert position_error(shape, reference(bending, Hold.HINGE)) < 1e-4


@pytest.mark.sampled(3)
@each_hold
@each_stiffness
def test_positions_forces_and_moments_converge_with_order_two(bending: float, hold: Hold) -> None:
    exact = reference(bending, hold)
    shapes = [on_mesh(bending, hold, segments) for segments in MESHES]
    errors = {
        "position": [position_error(shape, exact) for shape in shapes],
        "force": [np.linalg.norm(shape.grasp_wrenches[:, :3] - end_forces(exact)) for shape in shapes],
        "moment": [np.linalg.norm(shape.grasp_wrenches[:, 3:] - end_moments(exact)) for shape in shapes],
    }
    order = {name: float(np.log2(error[-2] / error[-1])) for name, error in errors.items()}
    assert order["position"] == pytest.approx(2.0, abs=0.07)  # measured 2.00 to 2.05
    assert order["force"] == pytest.approx(2.0, abs=0.3)  # measured 2.01 to 2.26, falling towards 2
    assert order["moment"] == pytest.approx(2.0, abs=0.15)  # measured 1.92 to 2.12


@pytest.mark.sampled(3)
@each_hold
@each_stiffness
def test_the_error_estimate_is_true_on_meshes_that_resolve_the_bends(bending: float, hold: Hold) -> None:
    exact = reference(bending, hold)
    for segments in (100, 200, 400):
        shape = on_mesh(bending, hold, segments)
        assert shape.error is not None
        # measured 0.91 (EI = 1e-4 on 100 segments, where the bends are barely resolved) to 1.38; the factor of safety is 1.3
        assert 0.9 < shape.error / position_error(shape, exact) < 1.5


@pytest.mark.parametrize("bending", [3e-5, pytest.param(1e-5, marks=pytest.mark.slow)])
def test_the_error_estimate_covers_a_boundary_layer_thinner_than_a_segment(bending: float) -> None:
    """At the clamps of a soft cable all bending is within sqrt(EI/H), 12 and 7 mm here."""
    exact = reference(1e-4, Hold.CLAMP)
    for softer in (3e-5, 1e-5):
        if softer >= bending:
            exact = solved(softer, Hold.CLAMP, END[0], exact)
    shape = ask(cable(bending=bending), held(Hold.CLAMP), tolerance=1e-3)
    assert position_error(shape, exact) < 1.5e-3


@each_hold
@each_stiffness
def test_forces_and_moments_on_the_whole_cable_sum_to_zero(bending: float, hold: Hold) -> None:
    force, moment = unbalance(cable(bending=bending), on_mesh(bending, hold, 100), held(hold))
    assert force < 1e-14  # measured 9e-16 of the weight
    assert moment < 1e-8  # measured 6e-16 to 4.9e-9 of weight times length; the start is near, so one Newton step ends it


def test_the_reported_residual_is_that_of_the_answer() -> None:
    """`Shape.residual` is the largest unbalanced force; the cable weighs 1 N, and the same answer asked again moves by 1e-12 m."""
    shape = on_mesh(1e-2, Hold.CLAMP, 400)
    assert shape.residual < 1e-3
