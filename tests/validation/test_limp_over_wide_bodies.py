"""A cable without bending over wide bodies without friction: closed form in the plane (`wound.py`), and what statics asks of any shape.

In the plane two catenaries and an arc meet where tangent and T - w z go on; nothing of that reference is shared with the solver. Aside of
the plane the horizontal force along a horizontal cylinder is one number for both pieces, and every push is along the normal.
"""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from posed import around, ask, cable, frame, grasps, start_from, touches
from wound import Wound, hung_over

from protocol.kinds import Feature, Hold, Outcome
from protocol.messages import Contacts, Grasps, Shape

# m, distance of the axis of a cable of 1 m that weighs 1 N; x away from the cylinder and z, of the left and the right end.
WIDE = {
    0.05: ((0.28, -0.37), (0.32, -0.30)),
    0.1: ((0.28, -0.30), (0.30, -0.22)),
    0.15: ((0.30, -0.20), (0.33, -0.12)),
}
KINDS = {"cylinder": (Feature.EDGE, (0.0, 1.0, 0.0)), "sphere": (Feature.VERTEX, (0.0, 0.0, 0.0))}
FRAME = frame((1.0, 0.0, 0.0))


def held(distance: float, aside: float) -> Grasps:
    (left, low), (right, high) = WIDE[distance]
    return grasps((0.0, (-left, -aside, low), FRAME, Hold.HINGE), (1.0, (right, aside, high), FRAME, Hold.HINGE))


def rows(distance: float, kind: str) -> Contacts:
    """Places along the middle of the cable as a search finds them, all of them touching."""
    feature, direction = KINDS[kind]
    s = np.linspace(0.5 - 1.7 * distance, 0.5 + 1.7 * distance, 41)
    angle = (s - 0.5) / distance
    given = [(float(at), feature, (0.0, 0.0, 0.0), (np.sin(a), 0.0, np.cos(a)), direction) for at, a in zip(s, angle, strict=True)]
    found = touches(*given, distance=distance)
    return msgspec.structs.replace(found, force=0.01 * found.normal)


def lying(distance: float, kind: str = "cylinder", aside: float = 0.0, tolerance: float = 1e-5) -> Shape:
    shape = ask(cable(), held(distance, aside), contacts=rows(distance, kind), tolerance=tolerance)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.model == "catenary"
    return shape


def exact(distance: float) -> Wound:
    return hung_over(weight=1.0, length=1.0, distance=distance, ends=WIDE[distance])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("distance", WIDE)
def test_lift_offs_pushes_and_the_shape_are_those_of_the_closed_form(distance: float, kind: str) -> None:
    wanted, shape = exact(distance), lying(distance, kind)
    assert shape.error is not None
    assert np.linalg.norm(shape.nodes - wanted.positions(shape.s), axis=1).max() < shape.error + 1e-7
    push = shape.contact_forces.sum(axis=0)
    assert push[[0, 2]] == pytest.approx(wanted.push, abs=2e-6)  # N
    first, last = wanted.touched
    away = np.linalg.norm(shape.nodes, axis=1)
    on = shape.s[away < distance + 1.5 * shape.error + 1e-9]
    spacing = float(np.diff(shape.s).max())
    assert abs(on[0] - first) < 2 * spacing
    assert abs(on[-1] - last) < 2 * spacing
    assert abs(push[1]) < 1e-9


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("aside", [0.0, 0.05, 0.12])
def test_statics_holds_for_any_shape(aside: float, kind: str) -> None:
    shape, distance = lying(0.1, kind, aside, tolerance=1e-4), 0.1
    total = shape.grasp_wrenches[:, :3].sum(axis=0) + shape.contact_forces.sum(axis=0)
    assert total == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    middle = 0.5 * (shape.nodes[1:] + shape.nodes[:-1])
    assert np.ptp(shape.tension - middle[:, 2]) < 1e-3  # N; of the polygon's middles
    pushing = np.flatnonzero(np.linalg.norm(shape.contact_forces, axis=1) > 0.0)
    assert len(pushing) > 5
    at = np.column_stack([np.interp(shape.contact_s[pushing], shape.s, column) for column in shape.nodes.T])
    normal = at - (at * KINDS[kind][1]) * KINDS[kind][1]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    force = shape.contact_forces[pushing]
    assert (np.einsum("ij,ij->i", force, normal) > 0.99 * np.linalg.norm(force, axis=1)).all()  # each spread over its part of the arc
    if kind == "cylinder":  # nothing pushes along it
        assert shape.grasp_wrenches[0, 1] == pytest.approx(-shape.grasp_wrenches[1, 1], abs=1e-9)
        assert abs(shape.contact_forces[:, 1].sum()) < 1e-9
    assert np.linalg.norm(shape.nodes - shape.nodes * np.array(KINDS[kind][1]), axis=1).min() > distance - 1e-6


def test_the_error_is_of_second_order_in_the_segments() -> None:
    """By tolerance: the nodes of an arc are outside by what the segments between them cut off."""
    wanted, off = exact(0.1), []
    for tolerance in (1e-3, 2.5e-4, 6e-5, 1.5e-5):
        shape = lying(0.1, tolerance=tolerance)
        off.append((len(shape.s), float(np.linalg.norm(shape.nodes - wanted.positions(shape.s), axis=1).max())))
    sizes, errors = np.array(off).T
    order = np.log(errors[0] / errors[-1]) / np.log(sizes[-1] / sizes[0])
    assert 1.7 < order < 2.3


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
@pytest.mark.parametrize("distance", WIDE)
def test_step_by_step_it_keeps_to_the_closed_form(distance: float, tolerance: float) -> None:
    """Both grippers move; every shape is the start of the next, whose contacts are those that a search finds about it."""
    shape, wanted = lying(distance, tolerance=tolerance), exact(distance)
    (left, low), (right, high) = WIDE[distance]
    for step in range(1, 6):
        ends = (left, low + 0.001 * step), (right - 0.001 * step, high - 0.001 * step)
        (x, z), (u, w) = ends
        moved = grasps((0.0, (-x, 0.0, z), FRAME, Hold.HINGE), (1.0, (u, 0.0, w), FRAME, Hold.HINGE))
        near = around(shape.nodes, shape.s, np.zeros(3), shape, distance)
        shape = ask(cable(), moved, contacts=near, start=start_from(shape), tolerance=tolerance)
        assert shape.outcome is Outcome.CONVERGED, shape.sentence
        assert "as a rod of" in shape.sentence
        wanted = hung_over(weight=1.0, length=1.0, distance=distance, ends=ends, near=wanted)
        assert shape.error is not None
        assert np.linalg.norm(shape.nodes - wanted.positions(shape.s), axis=1).max() < shape.error
        assert shape.error < 6.0 * tolerance  # measured 5.1: what two meshes differ by jumps where a row is met
        total = shape.grasp_wrenches[:, :3].sum(axis=0) + shape.contact_forces.sum(axis=0)
        assert total == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
        assert shape.contact_forces.sum(axis=0)[[0, 2]] == pytest.approx(wanted.push, abs=15.0 * tolerance)  # N, measured 10
        assert not shape.grasp_wrenches[:, 3:].any()
