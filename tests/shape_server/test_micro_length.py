"""A rod with a micro-structure length beside everything else the rod does, and what refuses it."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from linear_model import build
from rods import ALONG_X, GRAVITY, KERNELS, Row, cable, contacts, frame, grasps, random_spans, span, start_from
from scipy.interpolate import CubicSpline
from test_every_effect import replace_part

from protocol.errors import CablecosimError
from protocol.kinds import Feature, Hold, Model, Outcome
from protocol.messages import PointLoads, Problem, Shape
from shape_server import Follower, FollowerBatch, numpy_path, solve
from shape_server.port import port
from shape_server.rod import State

MICRO = replace(cable(), micro_length=0.05)
EDGE = Row(s=0.47, point=(0.28, 0.0, -0.2), direction=(0.0, 1.0, 0.0), feature=Feature.EDGE)
THREE = grasps((0.0, (0, 0, 0), ALONG_X), (0.5, (0.3, 0, 0.02), ALONG_X), (1.0, (0.6, 0, 0), ALONG_X))
LOADS = PointLoads(s=np.array([0.3, 0.62]), force=np.array([[0.2, 0.1, -0.5], [0.0, -0.3, 0.2]]))


def held_by(*holds: Hold) -> object:
    return replace_part(THREE, hold=holds)


PROBLEMS = {
    "contact": Problem(cable=MICRO, grasps=span(), contacts=contacts(EDGE)),
    "loads": Problem(cable=MICRO, grasps=span(), loads=LOADS),
    "stretch": Problem(cable=replace(MICRO, stretch=50.0), grasps=span(1.02)),
    "hinges": Problem(cable=MICRO, grasps=held_by(Hold.HINGE, Hold.HINGE, Hold.HINGE), model=Model.ROD),
    "guide": Problem(cable=MICRO, grasps=held_by(Hold.CLAMP, Hold.GUIDE, Hold.HINGE), model=Model.ROD),
    "clamp inside": Problem(cable=MICRO, grasps=THREE, model=Model.ROD),
    "one end": Problem(cable=MICRO, grasps=grasps((0.0, (0, 0, 0), ALONG_X)), model=Model.ROD),
    "out of the plane": Problem(cable=MICRO, grasps=grasps((0.0, (0, 0, 0), ALONG_X), (1.0, (0.6, 0.2, 0), frame((1.0, 1.0, 0.3))))),
    "turn of twist": Problem(cable=MICRO, grasps=span(0.8), turns=(1,)),
}


def unbalance(problem: Problem, shape: Shape) -> np.ndarray:
    """Sum (3,) [N m] of all moments about the origin, those of contacts left out."""
    middle = 0.5 * (shape.nodes[1:] + shape.nodes[:-1])
    weight = np.outer(problem.cable.mass_per_length * np.diff(shape.s), GRAVITY)
    out = shape.grasp_wrenches[:, 3:].sum(0) + np.cross(middle, weight).sum(0)
    at = np.column_stack([np.interp(problem.grasps.s, shape.s, row) for row in shape.nodes.T])
    out += np.cross(at, shape.grasp_wrenches[:, :3]).sum(0)
    if problem.loads is not None:
        places = np.column_stack([np.interp(problem.loads.s, shape.s, row) for row in shape.nodes.T])
        out += np.cross(places, problem.loads.force).sum(0)
    return np.asarray(out)


@pytest.mark.parametrize("name", PROBLEMS)
def test_the_rod_covers_it_and_keeps_the_balance(name: str) -> None:
    problem = PROBLEMS[name]
    shape = solve(problem, GRAVITY, margin=True, extrapolate=False, path=KERNELS)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert shape.model == "rod"
    assert "micro_length" in shape.effects
    assert shape.margin is not None
    assert shape.margin > 0.0
    if problem.contacts is None:
        assert np.abs(unbalance(problem, shape)).max() < 1e-7  # N m
    again = solve(msgspec.structs.replace(problem, start=start_from(shape)), GRAVITY, extrapolate=False, path=KERNELS)
    assert again.iterations <= 3
    np.testing.assert_allclose(again.nodes, shape.nodes, atol=1e-7)


def test_the_balance_holds_before_it_is_made_to() -> None:
    """The moments at the clamps from the sections alone, without `balanced`, close the moment balance of the settled rod."""
    problem = PROBLEMS["out of the plane"]
    shape = solve(problem, GRAVITY, extrapolate=False, path=KERNELS)
    system = build(msgspec.structs.replace(problem, start=start_from(shape)), GRAVITY)
    found = KERNELS.settle(system.rod, system.start(np.array(shape.frames)), 0.0)
    found = KERNELS.settle(system.rod, found[0], 0.0)
    moments = KERNELS.section_forces(system.rod, State(*found[0]), found[1])[3]
    np.testing.assert_allclose(moments, shape.grasp_wrenches[:, 3:], atol=1e-8)


@pytest.mark.parametrize("micro", [1e-4, 1e-2, 0.1, 1.0])
def test_random_cables_find_a_stable_shape(micro: float) -> None:
    for problem in random_spans(10, 1e-2, 5):
        shape = solve(
            msgspec.structs.replace(problem, cable=replace(problem.cable, micro_length=micro), model=Model.ROD), GRAVITY, path=KERNELS
        )
        assert shape.outcome is Outcome.CONVERGED, shape.sentence
        assert shape.error is not None
        assert shape.error < 1e-3


def test_both_paths_find_the_same_shape() -> None:
    shapes = [solve(PROBLEMS["out of the plane"], GRAVITY, path=path) for path in (KERNELS, numpy_path)]
    np.testing.assert_allclose(shapes[0].nodes, shapes[1].nodes, atol=1e-9)


@pytest.mark.slow  # it compiles for a minute
@pytest.mark.parametrize("extrapolate", [False, True])
def test_a_follower_takes_it_along(extrapolate: bool) -> None:
    problem = Problem(cable=MICRO, grasps=span(), model=Model.ROD)
    follower = Follower(problem, GRAVITY, extrapolate=extrapolate, segments=40)
    moved = np.array([[0.0, 0.0, 0.0], [0.602, 0.001, -0.001]])
    nodes = follower.move(moved, problem.grasps.quaternion)
    there = msgspec.structs.replace(problem, grasps=replace_part(problem.grasps, position=moved))
    exact = solve(there, GRAVITY, tolerance=1e-8, path=KERNELS)
    apart = np.linalg.norm(CubicSpline(exact.s, exact.nodes)(follower.s) - nodes, axis=1).max()
    assert apart < (2e-5 if extrapolate else 1e-3)  # m; measured 1.9e-6 and 5.4e-4 on 40 segments


def test_what_is_not_built_for_it_says_so() -> None:
    problem = Problem(cable=MICRO, grasps=span(), model=Model.ROD)
    with pytest.raises(CablecosimError, match="micro_length"):
        FollowerBatch([problem], GRAVITY)
    system = build(problem, GRAVITY)
    with pytest.raises(CablecosimError, match="micro_length"):
        port(system, system.start(np.tile(ALONG_X, (len(system.mesh.lengths), 1))), numpy_path)


@pytest.mark.parametrize("times", [10.0, pytest.param(100.0, marks=pytest.mark.slow)])
def test_a_micro_length_of_many_lengths_finds_a_shape_or_is_refused_with_the_reason(times: float) -> None:
    found = 0
    for problem in random_spans(6, 1e-2, seed=3):
        long = msgspec.structs.replace(problem, cable=replace(problem.cable, micro_length=times), model=Model.ROD)
        shape = solve(long, GRAVITY, path=KERNELS)
        found += shape.outcome is Outcome.CONVERGED
        assert shape.outcome is Outcome.CONVERGED or f"micro_length is {times:g} times the length" in shape.sentence
    assert found >= 2  # measured 4 and 2
