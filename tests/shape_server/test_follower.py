"""A cable kept up with its grasps is where `solve` puts it, however it is held and whatever it touches."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest
from rods import GRAVITY, KERNELS, RADIUS, Row, cable, contacts, span, start_from
from scipy.spatial.transform import Rotation

from protocol.errors import CablecosimError
from protocol.kinds import Feature, Friction, Hold
from protocol.messages import Contacts, Grasps, Problem, Shape
from shape_server import Follower, solve

HELD = {
    "clamps": Problem(cable=cable(), grasps=span()),
    "clamp and hinge": Problem(cable=cable(), grasps=msgspec.structs.replace(span(), hold=(Hold.CLAMP, Hold.HINGE))),
    "clamp and guide": Problem(cable=cable(), grasps=msgspec.structs.replace(span(), hold=(Hold.CLAMP, Hold.GUIDE))),
    "clamps, stretching": Problem(cable=replace(cable(), stretch=50.0), grasps=span()),
}
SEGMENTS = 48


def moved(held: Grasps, part: float) -> Grasps:
    """The same grasps, the last one elsewhere and turned in space."""
    position, quaternion = held.position.copy(), held.quaternion.copy()
    position[-1] += part * np.array([0.03, 0.05, -0.02])
    quaternion[-1] = (Rotation.from_rotvec(part * np.array([0.1, 0.2, -0.3])) * Rotation.from_quat(quaternion[-1])).as_quat()
    return msgspec.structs.replace(held, position=position, quaternion=quaternion)


def on_the_way(problem: Problem, extrapolate: bool = False) -> tuple[Follower, list[tuple[Grasps, np.ndarray]]]:
    """A follower led along a path in ten motions, and its nodes after each of them."""
    follower, path = Follower(problem, GRAVITY, segments=SEGMENTS, extrapolate=extrapolate), []
    for part in np.linspace(0.0, 1.0, 11)[1:]:
        held = moved(problem.grasps, float(part))
        path.append((held, follower.move(held.position, held.quaternion)))
    return follower, path


def solved(problem: Problem, held: Grasps, follower: Follower) -> Shape:
    """The same posture by `solve` on the same nodes, from the follower's frames."""
    start = start_from(solve(problem, GRAVITY, path=KERNELS))
    start = msgspec.structs.replace(start, s=follower.s, frames=follower.frames.copy())
    return solve(msgspec.structs.replace(problem, grasps=held, start=start), GRAVITY, extrapolate=False, path=KERNELS)


@pytest.mark.thorough
@pytest.mark.parametrize("name", HELD)
def test_a_follower_is_where_solve_is(name: str) -> None:
    follower, path = on_the_way(HELD[name])
    held, nodes = path[-1]
    assert np.abs(nodes - solved(HELD[name], held, follower).nodes).max() < 1e-6  # 3e-10 to 4e-7
    assert follower.is_stable


@pytest.mark.parametrize("name", ["clamps", *(pytest.param(name, marks=pytest.mark.slow) for name in list(HELD)[1:])])
def test_two_meshes_are_nearer_to_the_truth_than_one_and_say_how_far_the_one_is_off(name: str) -> None:
    problem = HELD[name]
    (_, coarse), (follower, fine) = on_the_way(problem), on_the_way(problem, extrapolate=True)
    held, nodes = fine[-1]
    exact = solve(msgspec.structs.replace(problem, grasps=held), GRAVITY, tolerance=1e-8, path=KERNELS)
    at = np.column_stack([np.interp(follower.s, exact.s, column) for column in exact.nodes.T])
    off, off_alone = np.abs(nodes - at).max(), np.linalg.norm(coarse[-1][1] - at, axis=1).max()
    assert off < 0.01 * off_alone  # a thousandth
    assert off_alone / 4 < follower.error < off_alone / 2  # of the finer mesh, which is four times as exact; 1.3 times that


@cache
def lowest() -> np.ndarray:
    """Lowest node (3,) [m] of the sagging cable that touches nothing."""
    nodes = solve(HELD["clamps"], GRAVITY, path=KERNELS).nodes
    return np.asarray(nodes[np.argmin(nodes[:, 2])])


def row(feature: Feature, friction: Friction = Friction.NONE, s: float = 0.5, rise: float = 0.02) -> Row:
    """Something that touches the sagging cable from below, raised by so much over where it would just touch [m]."""
    direction = (0.0, 1.0, 0.0) if feature is Feature.EDGE else (0.0, 0.0, 0.0)
    return Row(s=s, point=lowest() + np.array([0.0, 0.0, rise - RADIUS]), direction=direction, feature=feature, friction=friction)


def touching(given: Contacts) -> Problem:
    return msgspec.structs.replace(HELD["clamps"], contacts=given)


@pytest.mark.thorough
@pytest.mark.parametrize("friction", [Friction.NONE, Friction.BOND])
@pytest.mark.parametrize("feature", [Feature.FACE, Feature.EDGE])
def test_a_follower_that_touches_is_where_solve_is(feature: Feature, friction: Friction) -> None:
    problem = touching(contacts(row(feature, friction)))
    follower, held = Follower(problem, GRAVITY, segments=SEGMENTS), problem.grasps
    for part in np.linspace(0.0, 0.15, 4)[1:]:
        held = moved(problem.grasps, float(part))
        nodes = follower.move(held.position, held.quaternion)
    shape = solved(problem, held, follower)
    assert np.abs(nodes - shape.nodes).max() < 1e-6  # 1e-11 to 6e-8
    assert follower.contact_forces == pytest.approx(shape.contact_forces, abs=1e-5)
    assert follower.contact_forces[0, 2] > 0.1


def test_contacts_come_and_go() -> None:
    given, held = contacts(row(Feature.EDGE, rise=2e-3)), moved(span(), 0.02)
    follower, free = Follower(HELD["clamps"], GRAVITY, segments=SEGMENTS), Follower(HELD["clamps"], GRAVITY, segments=SEGMENTS)
    follower.touch(given)
    nodes = follower.move(held.position, held.quaternion)
    assert np.abs(nodes - solved(touching(given), held, follower).nodes).max() < 1e-6
    assert nodes[:, 2].min() > free.move(held.position, held.quaternion)[:, 2].min() + 1e-3
    follower.touch(None)
    assert follower.move(held.position, held.quaternion) == pytest.approx(free.move(held.position, held.quaternion), abs=1e-6)
    assert len(follower.contact_forces) == 0


def test_a_cable_slides_over_an_edge_along_many_segments() -> None:
    problem = touching(contacts(row(Feature.EDGE)))
    follower, far = Follower(problem, GRAVITY, segments=2 * SEGMENTS), problem.grasps.position.copy()
    for _ in range(40):
        far[:, 0] += 0.002
        nodes = follower.move(far, problem.grasps.quaternion)
    touched = follower.s[np.argmin(np.linalg.norm(nodes - row(Feature.EDGE).point, axis=1))]
    assert touched < 0.5 - 5 * follower.s[1]
    given = contacts(row(Feature.EDGE, s=float(touched)))
    shape = solved(touching(given), msgspec.structs.replace(problem.grasps, position=far), follower)
    assert np.abs(nodes - shape.nodes).max() < 1e-6
    assert follower.contact_forces == pytest.approx(shape.contact_forces, abs=1e-5)


def test_a_slide_by_more_than_a_segment_at_once_is_refused_and_forgotten() -> None:
    problem = touching(contacts(row(Feature.EDGE)))
    follower, far = Follower(problem, GRAVITY, segments=320), problem.grasps.position.copy()
    before = follower.frames.copy()
    far[:, 0] += 0.04
    with pytest.raises(CablecosimError, match="move the grasps by less"):
        follower.move(far, problem.grasps.quaternion)
    assert np.array_equal(follower.frames, before)
    for part in np.linspace(0.0, 1.0, 41)[1:]:
        follower.move(problem.grasps.position + part * (far - problem.grasps.position), problem.grasps.quaternion)


def test_a_motion_that_is_too_large_leaves_everything_as_it_was() -> None:
    follower, (_, nodes) = (lambda led: (led[0], led[1][-1]))(on_the_way(HELD["clamps"]))
    held = moved(span(), 1.0)
    with pytest.raises(CablecosimError, match="too large"):
        follower.move(held.position + np.array([[0.0] * 3, [-2.0, 2.0, 2.0]]), held.quaternion)
    assert follower.move(held.position, held.quaternion) == pytest.approx(nodes, abs=1e-7)


def test_what_is_not_followed_is_refused() -> None:
    given = touching(contacts(row(Feature.FACE)))
    with pytest.raises(CablecosimError, match="extrapolate"):
        Follower(given, GRAVITY, extrapolate=True)
    with pytest.raises(CablecosimError, match="bending"):
        Follower(Problem(cable=cable(bending=None), grasps=span()), GRAVITY)
