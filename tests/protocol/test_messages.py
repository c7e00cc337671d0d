"""Every message checks itself when it is made: sizes at their limits, values just inside and just outside."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest
from every_message import CABLE, contacts, frame, grasps, quaternions, request, shape, solid, start

from protocol.errors import MessageError
from protocol.kinds import Hold
from protocol.messages import CONTACTS_MAX, EXTENT_MAX, GRASPS_MAX, NODES_MAX, Contacts, Grasps, Problem, Start

replace = msgspec.structs.replace


def many_contacts(count: int) -> Contacts:
    """Contacts on a face, all alike."""
    return Contacts(
        s=np.zeros(count),
        body=np.zeros(count, np.int64),
        feature=np.zeros(count, np.int64),
        point=np.zeros((count, 3)),
        normal=np.tile([0.0, 0.0, 1.0], (count, 1)),
        direction=np.zeros((count, 3)),
        extent=np.zeros((count, 2)),
        distance=np.zeros(count),
        friction=np.zeros(count, np.int64),
        force=np.zeros((count, 3)),
    )


def many_grasps(count: int) -> Grasps:
    """Grasps along a cable."""
    return Grasps(s=np.linspace(0, 1, count), position=np.zeros((count, 3)), quaternion=quaternions(count), hold=(Hold.CLAMP,) * count)


def test_the_limits_themselves_are_allowed_and_one_more_is_not() -> None:
    many_contacts(CONTACTS_MAX)
    with pytest.raises(MessageError, match=f"contacts: {CONTACTS_MAX + 1} entries are too many; at most {CONTACTS_MAX}"):
        many_contacts(CONTACTS_MAX + 1)
    many_grasps(GRASPS_MAX)
    with pytest.raises(MessageError, match="grasps: 101 entries are too many"):
        many_grasps(GRASPS_MAX + 1)
    with pytest.raises(MessageError, match="start: 20001 entries are too many"):
        Start(s=np.linspace(0, 1, NODES_MAX + 1), frames=quaternions(NODES_MAX), grasp_forces=np.zeros((2, 3)))
    with pytest.raises(MessageError, match="problems: 101 entries are too many"):
        replace(request(), problems=request().problems * 101)


def test_no_contact_at_all_is_a_message_too() -> None:
    assert len(many_contacts(0).s) == 0


@pytest.mark.parametrize("value", [EXTENT_MAX, -EXTENT_MAX, np.inf, -np.inf, np.nan])
def test_a_coordinate_beyond_ten_kilometres_is_a_mistake(value: float) -> None:
    with pytest.raises(MessageError, match=r"grasps\.position: holds a value that is not finite, or not below 10000"):
        replace(grasps(), position=np.array([[0.0, 0, value], [0, 0, 0]]))


@pytest.mark.parametrize(
    ("length", "good"), [(1.0, True), (1 + 4e-7, True), (1 - 4e-7, True), (1 + 6e-7, False), (1 - 6e-7, False), (0.0, False)]
)
def test_a_quaternion_and_a_normal_have_length_one_to_within_5e_7(length: float, good: bool) -> None:
    for make in (
        lambda: replace(grasps(), quaternion=quaternions(2) * length),
        lambda: replace(contacts(), normal=contacts().normal * length),
        lambda: replace(start(), frames=start().frames * length),
    ):
        if good:
            make()
        else:
            with pytest.raises(MessageError, match="length 1"):
                make()


def test_the_direction_of_what_is_no_edge_is_not_looked_at() -> None:
    odd = contacts().direction.copy()
    odd[0] = 7.0
    assert replace(contacts(), direction=odd).direction[0, 0] == 7.0


@pytest.mark.parametrize("s", [[0.0], [], [0.0, 0.0], [1.0, 0.0]])
def test_a_start_shape_has_two_nodes_or_more_in_order(s: list[float]) -> None:
    with pytest.raises(MessageError, match=r"start\.(s|frames)"):
        Start(s=np.array(s), frames=quaternions(max(len(s) - 1, 0)), grasp_forces=np.zeros((2, 3)))


@pytest.mark.parametrize("name", ["length", "diameter", "bending", "twist", "mass_per_length"])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf, 1e12])
def test_a_cable_has_finite_positive_numbers(name: str, value: float) -> None:
    with pytest.raises(MessageError, match=rf"cable\.{name}: ") as caught:
        Problem(cable=dataclasses.replace(CABLE, **{name: value}), grasps=grasps())
    assert caught.value.key == f"cable.{name}"


def test_a_cable_may_be_without_mass_but_not_without_length() -> None:
    Problem(cable=dataclasses.replace(CABLE, mass_per_length=0.0), grasps=grasps())
    with pytest.raises(MessageError, match=r"cable\.length: 0\.0 must be positive"):
        Problem(cable=dataclasses.replace(CABLE, length=0.0), grasps=grasps())


def test_nobody_holds_a_cable_by_nothing() -> None:
    with pytest.raises(MessageError, match=r"grasps\.s: must have an entry or more"):
        Problem(cable=CABLE, grasps=many_grasps(0))


@pytest.mark.parametrize("tolerance", [0.0, -1e-3, np.nan, np.inf, 1e4])
def test_a_tolerance_is_positive_and_finite(tolerance: float) -> None:
    with pytest.raises(MessageError, match="tolerance: "):
        replace(request(), tolerance=tolerance)


@pytest.mark.parametrize("triangles", [[[0, 1, 3]], [[-1, 0, 1]]])
def test_a_solid_names_only_vertices_that_exist(triangles: list[list[int]]) -> None:
    with pytest.raises(MessageError, match=r"box\.triangles: names a vertex that does not exist"):
        replace(solid(), triangles=np.array(triangles))


@pytest.mark.parametrize(
    ("name", "value"),
    [("nodes", np.full((4, 3), np.nan)), ("nodes", np.zeros((4, 7))), ("nodes", np.zeros((3, 3))), ("frames", quaternions(4)),
     ("frames", np.zeros((3, 4))), ("tension", np.zeros(4)), ("curvature", np.zeros(3)), ("grasp_wrenches", np.zeros((2, 3))),
     ("contact_forces", np.zeros((3, 2))), ("contact_moments", np.zeros((2, 3))), ("contact_s", np.zeros(2)), ("s", np.zeros(4, np.int64))],
)  # fmt: skip
def test_a_shape_that_does_not_fit_together_is_no_message(name: str, value: np.ndarray) -> None:
    with pytest.raises(MessageError, match=r"^shape\."):
        replace(shape(), **{name: value})


@pytest.mark.parametrize("poses", [np.zeros((1, 2)), np.full((1, 7), np.nan)])
def test_a_frame_has_a_pose_for_every_solid(poses: np.ndarray) -> None:
    with pytest.raises(MessageError, match="poses"):
        replace(frame(), poses=poses)


def test_a_message_cannot_be_changed() -> None:
    with pytest.raises(AttributeError):
        request().step = 8
