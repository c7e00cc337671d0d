"""A heavy cable over a cylinder without friction, with bending against `scipy.integrate.solve_bvp` and without it in closed form.

The references are derived in `wound.py`. Claim: the solver finds where the cable lifts off on both sides, though only the length on both
together is given; what the cylinder pushes in all, and of that the force where the bent cable lifts off; T - w z the same all along
the arc; and the shape. A peg that is touched at one point is the edge of `test_contact_reference.py`.
"""

from __future__ import annotations

from functools import cache

import msgspec
import numpy as np
import pytest
from posed import ask, cable, frame, grasps, slope_frames, start_from, touches, unbalance
from wound import Ends, Wound, bent_over, hung_over

from protocol.kinds import Feature, Hold, Outcome
from protocol.messages import Contacts, Grasps, Shape, Start

DISTANCE = 0.05  # m, radius of cylinder and cable together
PLACES = ((0.28, -0.37), (0.32, -0.30))  # m, x away from the cylinder and z, of the left and the right end
ENDS: Ends = ((0.28, -0.37, -0.9), (0.32, -0.30, -0.8))
STIFFER = (1e-5, 1e-4, 3e-4, 1e-3)  # N m^2, each the guess for the next
TESTED = STIFFER[1:]
ACROSS = (0.0, 1.0, 0.0)
each_bending = pytest.mark.parametrize("bending", TESTED)


@cache
def hung() -> Wound:
    return hung_over(weight=1.0, length=1.0, distance=DISTANCE, ends=PLACES)


@cache
def exact(bending: float) -> Wound:
    place = STIFFER.index(bending)
    guess = exact(STIFFER[place - 1]) if place else hung()
    return bent_over(bending=bending, weight=1.0, length=1.0, distance=DISTANCE, ends=ENDS, guess=guess)


def clamps() -> Grasps:
    (left, low, first), (right, high, last) = ENDS
    return grasps(
        (0.0, (-left, 0.0, low), frame((np.cos(first), 0.0, -np.sin(first))), Hold.CLAMP),
        (1.0, (right, 0.0, high), frame((np.cos(last), 0.0, np.sin(last))), Hold.CLAMP),
    )


def around(nodes: np.ndarray, s: np.ndarray, reach: float) -> Contacts:
    """The axis of the cylinder as an edge, near every segment whose nearest point is within reach of its surface."""
    middle, at = 0.5 * (nodes[1:] + nodes[:-1]), 0.5 * (s[1:] + s[:-1])
    away = np.hypot(middle[:, 0], middle[:, 2])
    near = np.flatnonzero(away < DISTANCE + reach)
    normals = middle[near] / away[near, None]
    rows = [(float(at[k]), Feature.EDGE, (0.0, 0.0, 0.0), tuple(normal), ACROSS) for k, normal in zip(near, normals, strict=True)]
    return touches(*rows, distance=DISTANCE)


@cache
def on_mesh(bending: float, segments: int) -> Shape:
    """From a cable pressed flat against the cylinder over a wider arc than it lies on; the answer is the start of the next."""
    s = np.linspace(0.0, 1.0, segments + 1)
    nodes = exact(bending).positions(s)
    step = np.diff(nodes, axis=0)
    forces = np.zeros((2, 3))
    start = Start(s=s, frames=slope_frames(np.arctan2(step[:, 2], step[:, 0])), grasp_forces=forces)
    for _ in range(3):
        shape = ask(cable(bending=bending), clamps(), contacts=around(nodes, s, 0.004), start=start)
        assert shape.outcome is Outcome.CONVERGED, shape.sentence
        assert shape.is_stable
        nodes, start = shape.nodes, start_from(shape)
    return shape


def lift_off(shape: Shape) -> tuple[float, float]:
    """Arc lengths [m] of the first and the last contact that pushes."""
    pushing = np.flatnonzero(np.linalg.norm(shape.contact_forces, axis=1) > 1e-6)
    return float(shape.contact_s[pushing[0]]), float(shape.contact_s[pushing[-1]])


@pytest.mark.parametrize("bending", [0.0, *STIFFER])
def test_the_references_balance(bending: float) -> None:
    """Both ends, the weight of the arc and the quadrature of the pressure: found apart from each other."""
    found = exact(bending) if bending else hung()
    (left, low), (right, high) = found.forces
    total = found.push + np.array([right - left, high + low - DISTANCE * sum(found.angles)])
    assert np.abs(total).max() < 1e-10  # N; measured 2e-15
    assert (found.lifts > 1e-3).all() if bending else np.abs(found.lifts).max() < 1e-12


def test_the_stiff_reference_tends_to_the_closed_form() -> None:
    """By a boundary layer sqrt(EI / T) on both sides: the free cable is longer by that much, to first order."""
    layers = np.sqrt(1e-5 / hung().tensions)
    longer = np.array(exact(1e-5).free) - np.array(hung().free)
    assert longer == pytest.approx(layers, rel=0.06)  # measured 2.5 and 3.7 % less


@each_bending
def test_a_bent_cable_lies_on_the_cylinder_as_the_reference(bending: float) -> None:
    wanted, places, pushes = exact(bending), [], []
    for segments in (100, 200, 400):
        shape = on_mesh(bending, segments)
        places.append(np.abs(shape.nodes - wanted.positions(shape.s)).max())
        pushes.append(np.abs(shape.contact_forces[:, [0, 2]].sum(axis=0) - wanted.push).max())
    assert places[2] < 5e-5  # m; measured 3.0e-5 to 3.4e-5
    assert pushes[2] < 2e-3  # N of 1.1 to 1.4; measured 1.1e-3 to 1.2e-3
    for errors in (places, pushes):
        assert np.log2(errors[0] / errors[2]) / 2 == pytest.approx(2.0, abs=0.15)  # measured 1.95 to 2.02


@each_bending
@pytest.mark.parametrize("segments", [100, 200, 400])
def test_it_lifts_off_where_the_reference_does(bending: float, segments: int) -> None:
    """The contacts are those of the segments, so the ends of the arc are known to within one."""
    found = np.array(lift_off(on_mesh(bending, segments)))
    assert np.abs(found - exact(bending).touched).max() < 1.0 / segments  # measured 0.02 to 0.58 of a segment


@each_bending
def test_the_cylinder_pushes_with_a_force_of_its_own_where_the_cable_lifts_off(bending: float) -> None:
    """F, and the pressure within 15 mm of the lift-off; a contact on a segment stands for its length."""
    wanted, shape, near = exact(bending), on_mesh(bending, 400), 0.015
    size = np.linalg.norm(shape.contact_forces, axis=1)
    for side, (place, sign) in enumerate(zip(wanted.touched, (1.0, -1.0), strict=True)):
        pushed = size[sign * (shape.contact_s - place) < near].sum()
        pressure = wanted.tensions[side] / DISTANCE + wanted.weight * np.cos(wanted.angles[side])
        assert pushed == pytest.approx(wanted.lifts[side] + pressure * near, rel=0.05)  # measured 0.4 to 3.9 %


@each_bending
def test_tension_less_weight_times_height_is_one_number_on_the_arc(bending: float) -> None:
    wanted, shape = exact(bending), on_mesh(bending, 400)
    first, last = wanted.touched
    middle = 0.5 * (shape.s[1:] + shape.s[:-1])
    on_arc = (middle > first + 0.01) & (middle < last - 0.01)
    number = (shape.tension - 0.5 * (shape.nodes[1:, 2] + shape.nodes[:-1, 2]))[on_arc]
    assert np.ptp(number) < 1e-3  # N; measured 2.3e-4 to 6.0e-4
    assert number.mean() == pytest.approx(wanted.tensions[0] - DISTANCE * np.cos(wanted.angles[0]), abs=1e-3)  # measured 3.7e-4 to 6.1e-4


@each_bending
def test_forces_and_moments_balance_over_a_cylinder(bending: float) -> None:
    force, moment = unbalance(cable(bending=bending), on_mesh(bending, 200), clamps())
    assert force < 1e-13  # of the weight; measured 9e-16
    assert moment < 1e-13  # of weight times length; measured 2e-17


def hinges() -> Grasps:
    (left, low), (right, high) = PLACES
    level = frame((1.0, 0.0, 0.0))
    return grasps((0.0, (-left, 0.0, low), level, Hold.HINGE), (1.0, (right, 0.0, high), level, Hold.HINGE))


@pytest.mark.parametrize("distance", [0.001, 0.002])
def test_a_catenary_over_a_thin_peg_is_wrong_by_no_more_than_it_says(distance: float) -> None:
    """It bends the cable sharply outside the peg (`draped.py`), which a tolerance of a centimetre allows here."""
    wanted = hung_over(weight=1.0, length=1.0, distance=distance, ends=PLACES)
    first, last = wanted.touched
    row = (0.5 * (first + last), Feature.EDGE, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), ACROSS)
    contact = msgspec.structs.replace(touches(row, distance=distance), force=np.array([[0.0, 0.0, 1.0]]))
    shape = ask(cable(), hinges(), contacts=contact, tolerance=0.01)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.model == "catenary"
    assert shape.error is not None
    off = np.linalg.norm(shape.nodes - wanted.positions(shape.s), axis=1).max()
    assert off < shape.error  # m; measured 3.9e-3 of 5.8e-3, and 7.7e-3 of 9.6e-3


def test_a_cable_that_hardly_bends_lies_on_the_cylinder_as_in_closed_form() -> None:
    """Its boundary layers, sqrt(EI / T) = 1.1 mm, are shorter than a segment."""
    wanted, s = hung(), np.linspace(0.0, 1.0, 401)
    nodes = wanted.positions(s)
    step = np.diff(nodes, axis=0)
    start = Start(s=s, frames=slope_frames(np.arctan2(step[:, 2], step[:, 0])), grasp_forces=np.zeros((2, 3)))
    shape = ask(cable(bending=1e-6), hinges(), contacts=around(nodes, s, 0.004), start=start)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert np.abs(shape.nodes - wanted.positions(s)).max() < 5e-5  # m; measured 2.6e-5
    assert np.abs(np.array(lift_off(shape)) - wanted.touched).max() < 1.0 / 400 + 1.1e-3  # m, a segment and a layer; measured 2.3e-3
    assert shape.contact_forces[:, [0, 2]].sum(axis=0) == pytest.approx(wanted.push, abs=1.5e-3)  # N of 1.5; measured 5.7e-4
    number = shape.tension - 0.5 * (shape.nodes[1:, 2] + shape.nodes[:-1, 2])
    assert number == pytest.approx(
        wanted.tensions[0] - DISTANCE * np.cos(wanted.angles[0]), abs=1e-3
    )  # N of 0.74, all along; measured 5.4e-4
