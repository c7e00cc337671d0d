"""Many problems over cores, and many cables over lanes: the same as one by one."""

from __future__ import annotations

import multiprocessing
import os
import signal
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from rods import GRAVITY, KERNELS, WEIGHTLESS, cable, contacts, grasps, random_spans, span, start_from
from rods import Row as ContactRow
from scipy.spatial.transform import Rotation

from protocol.codec import encode
from protocol.errors import CablecosimError
from protocol.kinds import Hold, Outcome
from protocol.messages import PointLoads, Problem, Shape, ShapeReply
from protocol.scene import LumpedMass, Section
from shape_server import Follower, numpy_path, solve
from shape_server.lane_rows import LANES
from shape_server.many import FollowerBatch, SolverPool, solve_many


def mixed() -> list[Problem]:
    """Spans, one out of reach, one hanging without bending, one that rests on a face."""
    too_far = Problem(cable=cable(), grasps=span(1.2))
    without_bending = Problem(cable=cable(bending=None), grasps=span(hold=Hold.HINGE))
    touching = Problem(cable=cable(), grasps=span(0.9), contacts=contacts(ContactRow(s=0.5, point=(0.45, 0.0, -0.1))))
    return [*random_spans(4, 1e-2, seed=5), too_far, without_bending, touching]


def bits(shape: Shape) -> bytes:
    """All that a shape says but what it cost."""
    cost = msgspec.structs.replace(shape.cost, solve=0.0, estimate=0.0, certify=0.0)
    priceless = msgspec.structs.replace(shape, cost=cost)
    return encode(ShapeReply(session="", step=0, round=0, shapes=(priceless,), busy=0.0))


@pytest.mark.thorough
@pytest.mark.parametrize("workers", [1, 2])
def test_many_problems_have_the_same_shapes_as_one_by_one_in_their_order(workers: int) -> None:
    problems = mixed()
    expected = [bits(solve(problem, GRAVITY, margin=True, path=KERNELS)) for problem in problems]
    assert [bits(shape) for shape in solve_many(problems, GRAVITY, margin=True, workers=workers)] == expected


@pytest.mark.thorough
def test_a_pool_is_kept_from_sweep_to_sweep_and_says_how_far_it_is() -> None:
    problems, said = random_spans(5, 1e-2, seed=6), []
    with SolverPool(2) as pool:
        first = pool.solve_many(problems, GRAVITY)
        children = {child.pid for child in multiprocessing.active_children()}
        second = pool.solve_many(problems, GRAVITY, progress=lambda done, total: said.append((done, total)))
        assert {child.pid for child in multiprocessing.active_children()} == children
    assert [bits(shape) for shape in first] == [bits(shape) for shape in second]
    assert said[-1] == (5, 5)
    assert [done for done, _ in said] == sorted(done for done, _ in said)


def test_progress_is_told_in_this_process_too_and_no_problems_have_no_shapes() -> None:
    said: list[tuple[int, int]] = []
    solve_many(random_spans(2, 1e-2, seed=1), GRAVITY, workers=1, progress=lambda done, total: said.append((done, total)))
    assert said == [(1, 2), (2, 2)]
    assert solve_many([], GRAVITY) == []


def test_the_numpy_path_may_be_asked_for() -> None:
    shapes = solve_many([Problem(cable=cable(), grasps=span()) for _ in range(2)], WEIGHTLESS, workers=2, path=numpy_path)
    assert [shape.cost.path for shape in shapes] == ["numpy", "numpy"]


@pytest.mark.thorough
def test_a_worker_that_dies_ends_the_sweep_with_a_sentence() -> None:
    def kill(done: int, total: int) -> None:
        for child in multiprocessing.active_children():
            assert child.pid is not None
            os.kill(child.pid, signal.SIGKILL)

    with SolverPool(2) as pool, pytest.raises(CablecosimError, match="a worker process ended before"):
        pool.solve_many(random_spans(200, 1e-3, seed=7), GRAVITY, tolerance=1e-5, progress=kill)


def test_a_wrong_problem_is_raised_from_a_worker() -> None:
    wrong = Problem(cable=cable(), grasps=grasps((0.0, (0.0, 0.0, 0.0), span().quaternion[0])))
    wrong = msgspec.structs.replace(wrong, start=start_from(solve(wrong, GRAVITY, path=KERNELS)), cable=cable(length=2.0))
    with pytest.raises(CablecosimError, match=r"start\.s"):
        solve_many([wrong, wrong], GRAVITY, workers=2)


def swept(problems: list[Problem], part: float) -> tuple[np.ndarray, np.ndarray]:
    """Poses (k, 2, 3) [m] and (k, 2, 4) of the clamps of all cables after a part of a turn."""
    position = np.array([problem.grasps.position for problem in problems])
    quaternion = np.array([problem.grasps.quaternion for problem in problems])
    for k in range(len(problems)):
        position[k, 0] += 0.02 * np.array([np.sin(part + k), 0.0, 1.0 - np.cos(part)])
        position[k, 1] += 0.03 * np.array([0.0, np.sin(part), np.cos(part + k) - np.cos(k)])
        quaternion[k, 1] = (Rotation.from_rotvec([0.0, 0.2 * np.sin(part), 0.1 * part]) * Rotation.from_quat(quaternion[k, 1])).as_quat()
    return position, quaternion


def cables(count: int) -> list[Problem]:
    """Random spans, the first with two axes, natural curvature, a section, a mass and a load."""
    problems = random_spans(count, 2e-2, seed=3)
    special = replace(
        problems[0].cable, bending_2=4e-2, natural_curvature=(0.3, 0.2, 0.1), sections=(Section(start=0.25, end=0.5, bending=5e-2),),
        masses=(LumpedMass(at=0.75, mass=0.02),),
    )  # fmt: skip
    load = PointLoads(s=np.array([0.6]), force=np.array([[0.1, 0.0, 0.2]]))
    return [msgspec.structs.replace(problems[0], cable=special, loads=load), *problems[1:]]


@pytest.mark.thorough
@pytest.mark.parametrize("count", [1, LANES, LANES + 3])
def test_a_batch_follows_as_a_follower_does(count: int) -> None:
    problems = cables(count)
    batch = FollowerBatch(problems, GRAVITY)
    followers = [Follower(problem, GRAVITY, segments=40) for problem in problems]
    for part in np.linspace(0.0, 1.0, 11)[1:]:
        position, quaternion = swept(problems, part)
        nodes = batch.move(position, quaternion)
        expected = np.array(
            [follower.move(*pose) for follower, pose in zip(followers, zip(position, quaternion, strict=True), strict=True)]
        )
        assert nodes.shape == (count, 41, 3)
        assert np.abs(nodes - expected).max() < 1e-9  # measured 1e-14
        assert batch.is_stable.tolist() == [follower.is_stable for follower in followers]


def test_a_batch_starts_from_the_shapes_given() -> None:
    problems = cables(2)
    given = [msgspec.structs.replace(problem, start=start_from(solve(problem, GRAVITY, path=KERNELS))) for problem in problems]
    there = np.array([problem.grasps.position for problem in problems]), np.array([problem.grasps.quaternion for problem in problems])
    assert np.abs(FollowerBatch(problems, GRAVITY).move(*there) - FollowerBatch(given, GRAVITY).move(*there)).max() < 1e-6


def test_a_motion_too_large_is_refused_and_changes_nothing() -> None:
    problems = cables(3)
    batch, other = FollowerBatch(problems, GRAVITY), FollowerBatch(problems, GRAVITY)
    position, quaternion = swept(problems, 0.1)
    far = position.copy()
    far[1, 1] += 0.9
    with pytest.raises(CablecosimError, match="cable 1 is too large"):
        batch.move(far, quaternion)
    assert batch.move(position, quaternion).tobytes() == other.move(position, quaternion).tobytes()


@pytest.mark.parametrize(
    ("problem", "sentence"),
    [
        (Problem(cable=cable(), grasps=span(hold=Hold.HINGE)), "clamped at both ends"),
        (Problem(cable=replace(cable(), stretch=100.0), grasps=span()), "without stretch"),
        (Problem(cable=cable(bending=None), grasps=span()), "with 'bending'"),
        (Problem(cable=replace(cable(), masses=(LumpedMass(at=0.01, mass=0.1),)), grasps=span()), "do not fit"),
    ],
)
def test_a_batch_says_which_cable_it_cannot_follow(problem: Problem, sentence: str) -> None:
    with pytest.raises(CablecosimError, match=rf"cable 1: .*{sentence}"):
        FollowerBatch([Problem(cable=cable(), grasps=span()), problem], GRAVITY)
    with pytest.raises(CablecosimError, match="one cable or more"):
        FollowerBatch([], GRAVITY)


def test_mixed_problems_end_as_they_should() -> None:
    outcomes = [shape.outcome for shape in solve_many(mixed(), GRAVITY, workers=1)]
    assert outcomes.count(Outcome.UNREACHABLE) == 1
    assert outcomes.count(Outcome.CONVERGED) == len(outcomes) - 1
