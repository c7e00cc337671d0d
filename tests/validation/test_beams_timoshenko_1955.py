"""Beams of several parts, with masses, point loads and guides, and the strings that they become when soft.

Source: Timoshenko 1955, "Strength of materials", part I, 3rd ed., chs. V and VI (small deflections by integrating the moment);
Varignon 1725, "Nouvelle mecanique ou statique" (the loaded string); Irvine 1981, "Cable structures", MIT Press, ch. 1.

Claims, small deflections with EI = 1 N m^2 and L = 1 m unless said:
- cantilever of two parts, with the joint at a: F int (L - s)^2 / EI(s) ds at its tip;
- cantilever with a force at a: F a^2 (3 L - a) / 6 at its tip, for a point load and for a mass alike;
- clamp and guide: F / 192 under a force in the middle, w / 384 under a weight, and 12 d of force if the guide stands d higher;
- beyond a guide a beam is a cantilever.
Large deflections as in `cantilever`, by shooting. A soft cable with one load hangs in a V; with two weights, in two catenaries.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cantilever import Part, cantilever
from loaded import answer, place, pose, unbalanced
from posed import G, cable, frame, grasps
from scipy.integrate import quad
from scipy.optimize import root

from protocol.cable import LumpedMass, Section
from protocol.kinds import Hold, Outcome
from protocol.messages import Grasps

ALONG = frame((1.0, 0.0, 0.0))
ORIGIN = (0.0, 0.0, 0.0)
FOOT = grasps((0.0, ORIGIN, ALONG, Hold.CLAMP))
BEAM = cable(bending=1.0, twist=0.8, weight=0.0)
FORCE = 1e-3  # N
JOINT = 0.4  # m
each_jump = pytest.mark.parametrize("jump", [1e2, 1e4, 1e-2, 1e-4])


def guided(s: float = 1.0, height: float = 0.0) -> Grasps:
    return grasps((0.0, ORIGIN, ALONG, Hold.CLAMP), (s, (s, 0.0, height), ALONG, Hold.GUIDE))


def jumping(jump: float):  # a cable
    return replace(BEAM, sections=(Section(start=JOINT, end=1.0, bending=jump, twist=jump),))


@each_jump
def test_a_cantilever_whose_stiffness_jumps_bends_as_both_parts(jump: float) -> None:
    force = FORCE * min(1.0, jump)
    exact = force * ((1 - (1 - JOINT) ** 3) / 3 + (1 - JOINT) ** 3 / 3 / jump)
    by_parts = force * (quad(lambda s: (1 - s) ** 2, 0.0, JOINT)[0] + quad(lambda s: (1 - s) ** 2 / jump, JOINT, 1.0)[0])
    assert by_parts == pytest.approx(exact, rel=1e-12)
    shape = answer(pose(jumping(jump), FOOT, (1.0, (0.0, 0.0, -force))), tolerance=1e-10)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.nodes[-1, 2] == pytest.approx(-exact, rel=2e-5)


@pytest.mark.sampled(2)
@each_jump
def test_a_cantilever_whose_stiffness_jumps_bends_far_as_by_shooting(jump: float) -> None:
    force = (0.0, 0.0, -3.0 * min(1.0, jump))
    tip, moment = cantilever((Part(JOINT, (1.0, 1.0, 0.8)), Part(1 - JOINT, (jump, jump, jump), force=force)), ALONG, steps=2)
    for tolerance in (1e-3, 1e-5):
        shape = answer(pose(jumping(jump), FOOT, (1.0, force)), tolerance=tolerance)
        assert shape.outcome is Outcome.CONVERGED, shape.sentence
        assert shape.nodes[-1] == pytest.approx(tip[-1], abs=tolerance)
    assert shape.grasp_wrenches[0, 3:] == pytest.approx(-moment, abs=1e-4 * np.abs(moment).max())


@pytest.mark.thorough
def test_a_cantilever_of_many_parts_hangs_as_by_shooting() -> None:
    """Jumps of weight, of stiffness and of natural curvature, two masses, and a force in no plane."""
    soft, stiff, curl, push = (0.1, 0.1, 0.07), (0.3, 0.3, 0.07), (1.0, 3.0, 2.0), (0.1, 0.3, 0.2)
    rod = replace(
        cable(bending=0.1, twist=0.07),
        sections=(Section(start=0.2, end=0.5, mass_per_length=5 / G), Section(start=0.6, end=0.8, natural_curvature=curl, bending=0.3)),
        masses=(LumpedMass(0.35, 0.5 / G), LumpedMass(1.0, 0.1 / G)),
    )
    parts = (
        Part(0.2, soft, 1.0),
        Part(0.15, soft, 5.0, force=(0.0, 0.0, -0.5)),
        Part(0.15, soft, 5.0),
        Part(0.1, soft, 1.0),
        Part(0.1, stiff, 1.0, curl, push),
        Part(0.1, stiff, 1.0, curl),
        Part(0.2, soft, 1.0, force=(0.0, 0.0, -0.1)),
    )
    joints, moment = cantilever(parts, ALONG, steps=6)
    problem = pose(rod, FOOT, (0.7, push))
    for tolerance in (1e-3, 1e-5, 1e-7):
        shape = answer(problem, tolerance=tolerance)
        assert shape.outcome is Outcome.CONVERGED, shape.sentence
        assert np.linalg.norm(place(shape, np.cumsum([part.length for part in parts])) - joints, axis=1).max() < tolerance
        assert max(unbalanced(problem, shape)) < 1e-9
    assert shape.grasp_wrenches[0, 3:] == pytest.approx(-moment, abs=1e-5)  # N m


@pytest.mark.parametrize("at", [0.25, 0.3333, 0.6, 1.0])
def test_a_force_or_a_mass_on_a_cantilever_bends_it_by_the_formula(at: float) -> None:
    exact = -FORCE * at**2 * (3 - at) / 6
    by_force = answer(pose(BEAM, FOOT, (at, (0.0, 0.0, -FORCE))), tolerance=1e-10)
    by_mass = answer(pose(replace(BEAM, masses=(LumpedMass(at, FORCE / G),)), FOOT), tolerance=1e-10)
    assert by_force.nodes[-1, 2] == pytest.approx(exact, rel=2e-5)
    assert by_mass.nodes[-1, 2] == pytest.approx(exact, rel=2e-5)
    assert by_force.grasp_wrenches[0] == pytest.approx([0.0, 0.0, FORCE, 0.0, -FORCE * at, 0.0], abs=1e-8)


def test_a_beam_between_a_clamp_and_a_guide_bends_by_the_formulas() -> None:
    """Without tension: a guide lets the end come nearer. Checked with the curvature, w (6 s - 6 s^2 - 1) / 12, integrated twice."""
    middle = quad(lambda s: (0.5 - s) * (1 - 6 * s + 6 * s**2) / 12, 0.0, 0.5)[0]
    assert middle == pytest.approx(1 / 384, rel=1e-12)
    pushed = answer(pose(BEAM, guided(), (0.5, (0.0, 0.0, -FORCE))), tolerance=1e-10)
    assert place(pushed, 0.5)[2] == pytest.approx(-FORCE / 192, rel=1e-4)
    heavy = answer(pose(cable(bending=1.0, weight=FORCE), guided()), tolerance=1e-10)
    assert place(heavy, 0.5)[2] == pytest.approx(-FORCE / 384, rel=1e-4)
    assert heavy.grasp_wrenches[:, [2, 4]] == pytest.approx(np.array([[0.5, -1 / 12], [0.5, 1 / 12]]) * FORCE, abs=1e-4 * FORCE)
    higher = answer(pose(BEAM, guided(height=FORCE)), tolerance=1e-10)
    assert higher.grasp_wrenches[:, 2] == pytest.approx(np.array([-12.0, 12.0]) * FORCE, rel=1e-4)
    assert higher.grasp_wrenches[:, 4] == pytest.approx(np.array([6.0, 6.0]) * FORCE, rel=1e-4)
    assert np.abs(np.concatenate([shape.grasp_wrenches[:, 0] for shape in (pushed, heavy, higher)])).max() < 1e-9  # N


def test_a_beam_is_a_cantilever_beyond_its_guide() -> None:
    shape = answer(pose(BEAM, guided(0.5), (1.0, (0.0, 0.0, -FORCE))), tolerance=1e-10)
    assert shape.nodes[-1, 2] == pytest.approx(-FORCE / 24, rel=2e-5)
    assert shape.grasp_wrenches[1] == pytest.approx([0.0, 0.0, FORCE, 0.0, -FORCE / 2, 0.0], abs=1e-4 * FORCE)
    assert np.abs(shape.grasp_wrenches[0]).max() < 1e-6 * FORCE


def hinged(x: float, z: float = 0.0) -> Grasps:
    return grasps((0.0, ORIGIN, ALONG, Hold.HINGE), (1.0, (x, 0.0, z), ALONG, Hold.HINGE))


@pytest.mark.parametrize("by_mass", [False, True])
@pytest.mark.parametrize("at", [0.3, 0.5])
def test_a_soft_cable_with_one_load_hangs_in_a_v(at: float, by_mass: bool) -> None:
    """The load is at the corner of the triangle; the rounding at the bend is of the size sqrt(EI / T)."""
    x = (at**2 - (1 - at) ** 2 + 0.64) / 1.6
    corner = np.array([x, 0.0, -np.sqrt(at**2 - x**2)])
    assert np.hypot(0.8 - x, corner[2]) == pytest.approx(1 - at, rel=1e-12)
    gaps = []
    for bending in (1e-4, 1e-6):
        rod = replace(cable(bending=bending, weight=0.0), masses=(LumpedMass(at, 1 / G),) if by_mass else ())
        problem = pose(rod, hinged(0.8), *([] if by_mass else [(at, (0.0, 0.0, -1.0))]))
        shape = answer(problem, tolerance=1e-5)
        assert shape.outcome is Outcome.CONVERGED, shape.sentence
        assert max(unbalanced(problem, shape)) < 1e-9
        gaps.append(np.linalg.norm(place(shape, at) - corner))
    assert gaps[1] < 3e-4  # m; measured 1.8e-4 to 2.6e-4
    assert gaps[0] / gaps[1] == pytest.approx(10.0, rel=0.2)


def two_catenaries(far: float, x: float, z: float) -> tuple[np.ndarray, np.ndarray]:
    """Place of the joint (3,) [m] and force (2,) [N] at s = 0 of a cable that weighs 1 N/m up to the joint and `far` beyond."""

    def piece(weight: float, length: float, H: float, V: float) -> np.ndarray:
        up = V + weight * length
        return np.array([H * (np.arcsinh(up / H) - np.arcsinh(V / H)), np.hypot(H, up) - np.hypot(H, V)]) / weight

    def end(n: np.ndarray) -> np.ndarray:
        return piece(1.0, JOINT, *n) + piece(far, 1 - JOINT, n[0], n[1] + JOINT) - [x, z]

    found = root(end, [0.4 * far + 0.1, -0.4 * far - 0.2], tol=1e-13)
    assert np.abs(end(found.x)).max() < 1e-10
    joint = piece(1.0, JOINT, *found.x)
    length = quad(lambda s: found.x[0] / np.hypot(found.x[0], found.x[1] + s), 0.0, JOINT)[0]
    assert length == pytest.approx(joint[0], rel=1e-9)  # second derivation of the piece: dx/ds = H / T
    return np.array([joint[0], 0.0, joint[1]]), found.x


@pytest.mark.parametrize("far", [0.01, 5.0, 100.0])
def test_a_soft_cable_of_two_weights_hangs_in_two_catenaries(far: float) -> None:
    joint, force = two_catenaries(far, 0.8, 0.1)
    rod = replace(cable(bending=1e-6), sections=(Section(start=JOINT, end=1.0, mass_per_length=far / G),))
    problem = pose(rod, hinged(0.8, 0.1))
    shape = answer(problem, tolerance=1e-6)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert place(shape, JOINT) == pytest.approx(joint, abs=5e-5)  # m; measured 5e-8 to 2.1e-5, by the stiffness
    assert shape.grasp_wrenches[0, [0, 2]] == pytest.approx(-force, rel=1e-3, abs=1e-4)
    assert max(unbalanced(problem, shape)) < 1e-9
