"""Where a cable meets itself: against brute force over all pairs of places."""

from __future__ import annotations

import numpy as np
import pytest

from env_server.self_touch import SelfCandidates, search

RADIUS = 0.005  # m


def tangle(seed: int, count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3) [m] of a random smooth curve of one metre that comes near itself often, and their arc lengths."""
    rng = np.random.default_rng(seed)
    steps, direction = [], np.array([1.0, 0.0, 0.0])
    turn = rng.normal(size=3)
    for _ in range(count):
        turn = 0.8 * turn + 0.6 * rng.normal(size=3)
        direction = direction + 0.35 * np.cross(turn, direction)
        direction /= np.linalg.norm(direction)
        steps.append(direction / count)
    nodes = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    return nodes, np.linspace(0.0, 1.0, count + 1)


def least(nodes: np.ndarray, s: np.ndarray, more: float) -> float:
    """Least distance [m] of two places further apart along the cable than pi radius and `more`, by sampling every segment 40 times."""
    places = np.linspace(0.0, len(s) - 1.0, 40 * (len(s) - 1) + 1)
    points = np.column_stack([np.interp(places, np.arange(len(s)), column) for column in nodes.T])
    arc = np.interp(places, np.arange(len(s)), s)
    away = np.linalg.norm(points[:, None] - points[None], axis=2)
    away[np.abs(arc[:, None] - arc[None]) <= np.pi * RADIUS + more] = np.inf
    return float(away.min())


def nearest(found: SelfCandidates) -> float:
    """Least distance [m] that the search found."""
    return float(found.gap.min()) + 2 * RADIUS


@pytest.mark.sampled(3)
@pytest.mark.parametrize("seed", range(8))
def test_the_nearest_two_places_are_found(seed: int) -> None:
    nodes, s = tangle(seed)
    found = search(nodes, s, RADIUS, 0.1, 0.1)
    # Of two segments on the edge of what counts as a bend, those places count that are nearest.
    assert found.clearance.min() <= least(nodes, s, 2.0 / (len(s) - 1)) + 1e-9
    assert found.clearance.min() > least(nodes, s, 0.0) - 3e-4  # m, what sampling misses
    assert nearest(found) >= found.clearance.min() - 1e-12


@pytest.mark.parametrize("seed", range(8))
def test_every_pair_is_a_minimum_along_the_second_strand(seed: int) -> None:
    nodes, s = tangle(seed)
    found = search(nodes, s, RADIUS, 0.1, 0.1)
    assert len(found.gap)

    def point(place: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(place, np.arange(len(s)), column) for column in nodes.T])

    first = point(found.place[:, 0])
    here = np.linalg.norm(first - point(found.place[:, 1]), axis=1)
    np.testing.assert_allclose(here, found.gap + 2 * RADIUS, atol=1e-10)
    for step in (-1e-4, 1e-4):
        beside = np.linalg.norm(first - point(np.clip(found.place[:, 1] + step, 0.0, len(s) - 1.0)), axis=1)
        assert (beside >= here - 1e-12).all()
    arc = np.interp(found.place, np.arange(len(s)), s)
    assert (arc[:, 1] - arc[:, 0]).min() > np.pi * RADIUS - 1e-4


def test_two_strands_side_by_side_have_a_pair_in_every_cell() -> None:
    x = np.linspace(0.0, 0.5, 26)
    turn = np.linspace(-np.pi / 2, np.pi / 2, 12)[1:-1]
    bend = np.column_stack([0.5 + 0.008 * np.cos(turn), 0.008 * np.sin(turn)])
    plane = np.vstack([np.column_stack([x, np.full(26, -0.008)]), bend, np.column_stack([x[::-1], np.full(26, 0.008)])])
    nodes = np.column_stack([plane, np.zeros(len(plane))])
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1))])
    found = search(nodes, s, RADIUS, 0.01, 0.01)
    assert set(range(24)) <= set(np.round(found.place[:, 0]).astype(int).tolist())
    np.testing.assert_allclose(found.gap[found.place[:, 0] < 24], 0.006, atol=1e-5)


def test_a_bend_no_tighter_than_the_cable_is_thick_does_not_meet_itself() -> None:
    angle = np.linspace(0.0, 0.9 * np.pi, 40)
    nodes = 1.02 * RADIUS * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1))])
    assert len(search(nodes, s, RADIUS, 0.01, 0.01).gap) == 0


def test_a_straight_cable_is_nowhere_near_itself() -> None:
    nodes = np.column_stack([np.linspace(0.0, 1.0, 101), np.zeros(101), np.zeros(101)])
    found = search(nodes, nodes[:, 0].copy(), RADIUS, 0.01, 0.01)
    assert len(found.gap) == 0
    assert found.penetration == 0.0
