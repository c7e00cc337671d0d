"""Absurd starts: random, folded back, too coarse, uneven, with wild forces."""

from __future__ import annotations

import time

import numpy as np
import pytest
from rods import ALONG_X, GRAVITY, KERNELS, cable, frame, is_honest, largest_moment, span, unbalanced_moment
from scipy.spatial.transform import Rotation

from protocol.kinds import Outcome
from protocol.messages import Problem, Start
from shape_server import solve

COUNT = 50
BACK = frame((-1.0, 0.0, 0.0))
STARTS = {
    "random": Rotation.random(COUNT, random_state=np.random.default_rng(1)).as_quat(),
    "straight back": np.tile(BACK, (COUNT, 1)),
    "zigzag": np.array([ALONG_X if j % 2 else BACK for j in range(COUNT)]),
    "coiled": Rotation.from_rotvec(np.outer(np.arange(COUNT), [0.0, 1.5, 0.0])).as_quat(),
    "twisted": (Rotation.from_quat(ALONG_X) * Rotation.from_rotvec(np.outer(np.arange(COUNT), [0.0, 0.0, 2.0]))).as_quat(),
    "signs mixed": np.tile(ALONG_X, (COUNT, 1)) * np.where(np.arange(COUNT) % 3, 1.0, -1.0)[:, None],
}


@pytest.mark.parametrize("force", [0.0, 1e3, 1e8])
@pytest.mark.parametrize("name", list(STARTS))
def test_an_absurd_start_ends_at_a_stable_shape(name: str, force: float) -> None:
    start = Start(s=np.linspace(0, 1, COUNT + 1), frames=STARTS[name], grasp_forces=np.full((2, 3), force))
    problem = Problem(cable=cable(), grasps=span(), start=start)
    begun = time.perf_counter()
    shape = solve(problem, GRAVITY, path=KERNELS)
    assert time.perf_counter() - begun < 10.0
    assert is_honest(shape)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert unbalanced_moment(problem, shape, GRAVITY) < 1e-4 * largest_moment(problem, shape)


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_a_start_of_very_few_segments_is_answered_or_refused(count: int) -> None:
    start = Start(s=np.linspace(0, 1, count + 1), frames=np.tile(ALONG_X, (count, 1)), grasp_forces=np.zeros((2, 3)))
    assert is_honest(solve(Problem(cable=cable(), grasps=span(), start=start), GRAVITY, path=KERNELS))


@pytest.mark.parametrize("smallest", [1e-3, 1e-6, 1e-9])
def test_segments_may_differ_by_orders_of_magnitude(smallest: float) -> None:
    s = np.concatenate([np.linspace(0, 0.5, 20), 0.5 + smallest * np.arange(1, 4), np.linspace(0.55, 1, 18)])
    start = Start(s=s, frames=np.tile(ALONG_X, (len(s) - 1, 1)), grasp_forces=np.zeros((2, 3)))
    problem = Problem(cable=cable(), grasps=span(), start=start)
    shape = solve(problem, GRAVITY, extrapolate=False, path=KERNELS)
    assert is_honest(shape)
    assert shape.outcome is Outcome.CONVERGED, shape.sentence
    assert unbalanced_moment(problem, shape, GRAVITY) < 1e-4 * largest_moment(problem, shape)
    assert shape.residual * smallest < 1e-8  # N m; rounding, of which a short segment makes a large force
