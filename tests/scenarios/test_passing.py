"""How near two cables come to each other, and what the summary says of it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from scenarios.passing import distance

ALONG_X = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("other", "known"),
    [
        ([[0.3, -1.0, 0.2], [0.3, 1.0, 0.2]], 0.2),  # across, inside both
        ([[0.3, -1.0, 0.0], [0.3, 1.0, 0.0]], 0.0),  # through it
        ([[0.0, 0.0, 0.1], [1.0, 0.0, 0.1]], 0.1),  # beside it
        ([[1.3, 0.0, 0.4], [2.0, 0.0, 0.4]], 0.5),  # from end to end
        ([[0.7, 0.6, 0.0], [0.7, 0.3, 0.0]], 0.3),  # an end above its middle
        ([[9.0, 0.0, 0.0], [9.0, 1.0, 0.0]], 1.0),  # out of reach
    ],
)
def test_the_least_distance_is_that_of_the_nearest_segments(other: list[list[float]], known: float) -> None:
    assert distance(ALONG_X, np.array(other), 1.0) == pytest.approx(known, abs=1e-15)
    assert distance(np.array(other), ALONG_X, 1.0) == pytest.approx(known, abs=1e-15)


@pytest.mark.thorough
def test_random_polylines_are_as_far_apart_as_their_sampled_points() -> None:
    rng, share = np.random.default_rng(3), np.linspace(0.0, 1.0, 400)[:, None]
    for _ in range(20):
        first, second = rng.normal(size=(5, 3)), rng.normal(size=(6, 3)) + 0.5
        points = [np.concatenate([a + share * (b - a) for a, b in itertools.pairwise(line)]) for line in (first, second)]
        sampled = min(float(np.linalg.norm(points[1] - point, axis=1).min()) for point in points[0])
        assert sampled - 0.02 < distance(first, second, 10.0) <= sampled + 1e-12
