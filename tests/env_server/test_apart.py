"""What is said to stay apart does, by brute force over the way; and what slides past each other is said to."""

from __future__ import annotations

import numpy as np
import pytest
from test_distances import distance_between_segments

from env_server.apart import Way, may_go, stay_apart
from env_server.distances import fixed

RADIUS = 0.005  # m


def straight(start: tuple[float, float, float], end: tuple[float, float, float], segments: int = 12) -> np.ndarray:
    return np.linspace(start, end, segments + 1)


def way(before: np.ndarray, after: np.ndarray) -> Way:
    steps = np.linalg.norm(np.diff(before, axis=0), axis=1)
    return Way(fixed(before), fixed(after), fixed(np.append(0.0, np.cumsum(steps))))


def nearest_on_the_way(first: Way, second: Way, skip: float = -1.0) -> float:
    """Least distance [m] of two segments, of those further along from each other than `skip` [m], at 201 times of the way."""
    i, j = (index.ravel() for index in np.meshgrid(np.arange(len(first.s) - 1), np.arange(len(second.s) - 1), indexing="ij"))
    if skip >= 0.0:
        far = (second.s[j + 1] - first.s[i] > skip) & (j >= i + 2)
        i, j = i[far], j[far]
    least = np.inf
    for t in np.linspace(0.0, 1.0, 201):
        a, b = ((1.0 - t) * one.before + t * one.after for one in (first, second))
        least = min(least, float(distance_between_segments(a[i], a[i + 1], b[j], b[j + 1]).min()))
    return least


@pytest.mark.thorough
def test_what_is_said_to_stay_apart_does() -> None:
    """Random cables, random ways; many are refused that would stay apart, and none is let go that would not."""
    rng, said, kept = np.random.default_rng(3), 0, 0
    for _ in range(300):
        ways = []
        for height in (0.0, 0.03):
            direction = rng.normal(size=3) * (0.1, 0.1, 0.02)
            before = np.array([0.0, 0.0, height]) + np.linspace(-1.0, 1.0, 9)[:, None] * direction + 0.002 * rng.normal(size=(9, 3))
            drift = rng.normal(size=3) * (0.02, 0.02, 0.01)
            ways.append(way(before, before + drift + 0.004 * rng.normal(size=(9, 3))))
        least = nearest_on_the_way(*ways)
        may = stay_apart(*ways, False, 0.0, RADIUS)
        said, kept = said + may, kept + (least >= RADIUS)
        assert least >= RADIUS - 1e-12 or not may
    assert kept > 100
    assert said > 0.9 * kept  # measured 0.98


def test_a_loop_that_is_pulled_open_stays_apart_from_itself_and_one_pulled_through_itself_does_not() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 33)
    loop = np.column_stack([0.05 * np.cos(angle), 0.05 * np.sin(angle), np.linspace(0.0, 0.012, 33)])
    opened, passed = way(loop, loop * (1.3, 1.3, 1.0)), way(loop, loop * (1.0, 1.0, -1.0))
    assert nearest_on_the_way(opened, opened, np.pi * RADIUS) > RADIUS
    assert may_go(opened, opened, RADIUS, is_own=True)
    assert nearest_on_the_way(passed, passed, np.pi * RADIUS) < RADIUS
    assert not may_go(passed, passed, RADIUS, is_own=True)


@pytest.mark.parametrize("far", [0.005, 0.02, 0.08])
def test_a_cable_may_be_drawn_over_another_one_as_far_as_it_likes(far: float) -> None:
    """Touching all the way: 16 radii along itself, where its distance alone would allow one radius."""
    lower = way(straight((0.0, -0.1, 0.0), (0.0, 0.1, 0.0)), straight((0.0, -0.1, 0.0), (0.0, 0.1, 0.0)))
    over = straight((-0.1, 0.0, 2 * RADIUS), (0.1, 0.0, 2 * RADIUS))
    assert may_go(lower, way(over, over + np.array([far, 0.0, 0.0])), RADIUS, is_own=False)


def test_a_cable_that_goes_through_another_one_may_not_and_one_on_other_nodes_is_not_known() -> None:
    lower = way(straight((0.0, -0.1, 0.0), (0.0, 0.1, 0.0)), straight((0.0, -0.1, 0.0), (0.0, 0.1, 0.0)))
    over = straight((-0.1, 0.0, 2 * RADIUS), (0.1, 0.0, 2 * RADIUS))
    assert not may_go(lower, way(over, over - np.array([0.0, 0.0, 4 * RADIUS])), RADIUS, is_own=False)
    assert not may_go(lower, None, RADIUS, is_own=False)
