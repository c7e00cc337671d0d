"""Closest points against numpy formulas of another kind, scipy's minimiser and trimesh."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.optimize import minimize

from env_server.distances import point_segment, point_triangle, segment_segment, segment_triangle

ROUND_OFF = 2e-12  # m, measured 2e-13 over coordinates up to 2 m, slivers and parallels included


def distance_to_segments(points: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Distance of points to segments, both (..., 3), by clamping the projection."""
    along = ends - starts
    square = np.maximum((along**2).sum(-1), 1e-300)
    fraction = np.clip(((points - starts) * along).sum(-1) / square, 0, 1)
    return np.linalg.norm(points - starts - fraction[..., None] * along, axis=-1)


def distance_between_segments(p: np.ndarray, q: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Least of the four distances of an end, and of the distance of the lines where its foot lies in both segments."""
    ends = [distance_to_segments(x, *y) for x, y in ((p, (a, b)), (q, (a, b)), (a, (p, q)), (b, (p, q)))]
    normal = np.cross(q - p, b - a)
    square = (normal**2).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (np.cross(a - p, b - a) * normal).sum(-1) / square
        u = (np.cross(a - p, q - p) * normal).sum(-1) / square
        lines = np.linalg.norm(p + t[..., None] * (q - p) - a - u[..., None] * (b - a), axis=-1)
        inside = (t >= 0) & (t <= 1) & (u >= 0) & (u <= 1)
    return np.minimum(np.min(ends, axis=0), np.where(inside, lines, np.inf))


def distance_to_triangles(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance of points (..., 3) to triangles (..., 3, 3): rim, and plane where the areal coordinates are positive."""
    a, b, c = np.moveaxis(corners, -2, 0)
    rim = np.min([distance_to_segments(points, *side) for side in ((a, b), (b, c), (c, a))], axis=0)
    normal = np.cross(b - a, c - a)
    square = (normal**2).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = (np.cross(points - a, c - a) * normal).sum(-1) / square
        w = (np.cross(b - a, points - a) * normal).sum(-1) / square
        plane = np.abs(((points - a) * normal).sum(-1)) / np.sqrt(square)
    return np.minimum(rim, np.where((v >= 0) & (w >= 0) & (v + w <= 1), plane, np.inf))


def distance_segments_triangles(starts: np.ndarray, ends: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance of segments (..., 3) to triangles (..., 3, 3); zero where they cross, by the signs of volumes."""
    a, b, c = np.moveaxis(corners, -2, 0)
    sides = [distance_between_segments(starts, ends, x, y) for x, y in ((a, b), (b, c), (c, a))]
    nearest = np.min([distance_to_triangles(starts, corners), distance_to_triangles(ends, corners), *sides], axis=0)
    volume = np.linalg.det
    along = ends - starts
    winding = [volume(np.stack(np.broadcast_arrays(along, x - starts, y - starts), axis=-2)) for x, y in ((a, b), (b, c), (c, a))]
    sides_of_plane = [volume(np.stack(np.broadcast_arrays(x - a, b - a, c - a), axis=-2)) for x in (starts, ends)]
    crosses = (np.min(winding, axis=0) > 0) | (np.max(winding, axis=0) < 0)
    return np.where(crosses & (sides_of_plane[0] * sides_of_plane[1] < 0), 0.0, nearest)


def distances_of_pairs(segments: np.ndarray, corners: np.ndarray) -> np.ndarray:
    found = np.empty(len(segments))
    for i, ((p, q), triangle) in enumerate(zip(segments, corners, strict=True)):
        fraction, point = segment_triangle(tuple(p), tuple(q), *(tuple(corner) for corner in triangle))
        assert 0 <= fraction <= 1
        found[i] = np.linalg.norm(p + fraction * (q - p) - point)
    return found


def random_pairs(seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    return random.uniform(-1, 1, (count, 2, 3)), random.uniform(-1, 1, (count, 3, 3))


def slivers(seed: int, count: int) -> np.ndarray:
    """Triangles whose height is 1e-3 to 1e-7 of their length."""
    random = np.random.default_rng(seed)
    corners = random.uniform(-1, 1, (count, 3, 3))
    middle = corners[:, 0] + random.uniform(0, 1, (count, 1)) * (corners[:, 1] - corners[:, 0])
    corners[:, 2] = middle + 10.0 ** random.uniform(-7, -3, (count, 1)) * (corners[:, 2] - middle)
    return corners


def test_a_segment_and_a_triangle_are_as_close_as_the_oracle_says() -> None:
    segments, corners = random_pairs(1, 4000)
    oracle = distance_segments_triangles(segments[:, 0], segments[:, 1], corners)
    assert (oracle == 0).sum() > 100
    assert np.abs(distances_of_pairs(segments, corners) - oracle).max() < ROUND_OFF


def test_slivers_are_measured_exactly() -> None:
    segments, _ = random_pairs(2, 3000)
    corners = slivers(3, 3000)
    oracle = distance_segments_triangles(segments[:, 0], segments[:, 1], corners)
    # 1e-9: a crossing through a rim that both formulas see on different sides; heights are 1e-7 and the rim is within it.
    assert np.abs(distances_of_pairs(segments, corners) - oracle).max() < 1e-9


def test_the_closest_pair_is_what_a_minimiser_finds() -> None:
    segments, corners = random_pairs(4, 12)
    for (p, q), (a, b, c), found in zip(segments, corners, distances_of_pairs(segments, corners), strict=True):

        def square(x: np.ndarray, p=p, q=q, a=a, b=b, c=c) -> float:
            t, v, w = x
            return float(((p + t * (q - p) - a - v * (b - a) - w * (c - a)) ** 2).sum())

        limits = {"bounds": [(0, 1)] * 3, "constraints": {"type": "ineq", "fun": lambda x: 1 - x[1] - x[2]}}
        best = min(minimize(square, start, method="SLSQP", tol=1e-14, **limits).fun for start in (np.full(3, 0.3), np.zeros(3)))
        assert np.sqrt(max(best, 0.0)) == pytest.approx(found, abs=1e-5)  # SLSQP leaves 1e-6 where they cross


def test_points_agree_with_trimesh() -> None:
    segments, corners = random_pairs(5, 1000)
    points = segments[:, 0]
    found = np.array([point_triangle(tuple(x), *(tuple(c) for c in t)) for x, t in zip(points, corners, strict=True)])
    assert np.abs(found - trimesh.triangles.closest_point(corners, points)).max() < ROUND_OFF


@pytest.mark.parametrize("sine", [1e-2, 1e-4, 1e-6, 1e-8, 1e-12, 0.0])
def test_nearly_parallel_segments_keep_their_digits(sine: float) -> None:
    random = np.random.default_rng(6)
    for _ in range(300):
        p, q, shift, tilt = random.uniform(-1, 1, (4, 3))
        a = p + shift
        b = a + random.uniform(-2, 2) * (q - p) + sine * tilt
        t, u = segment_segment(tuple(p), tuple(q), tuple(a), tuple(b))
        found = np.linalg.norm(p + t * (q - p) - a - u * (b - a))
        assert found == pytest.approx(float(distance_between_segments(p, q, a, b)), abs=1e-10)


def test_segments_and_triangles_may_shrink_to_points() -> None:
    origin, up, side = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (3.0, 0.0, 0.0)
    assert point_segment(up, origin, origin) == 0.0
    assert segment_segment(up, up, origin, side) == (0.0, 0.0)
    assert segment_segment(origin, side, (1.5, 0.0, 1.0), (1.5, 0.0, 1.0))[0] == pytest.approx(0.5)
    assert segment_segment(up, up, side, side) == (0.0, 0.0)
    assert point_triangle(up, origin, origin, origin) == origin
    assert point_triangle((1.0, 1.0, 0.0), origin, side, side) == pytest.approx((1.0, 0.0, 0.0))
    assert segment_triangle(up, (1.0, 0.0, 0.5), origin, side, side)[1] == pytest.approx((1.0, 0.0, 0.0))


def test_a_segment_in_the_plane_of_a_triangle_touches_it() -> None:
    fraction, point = segment_triangle((-1.0, 0.2, 0.0), (1.0, 0.2, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert -1.0 + 2.0 * fraction == pytest.approx(point[0])
    assert point[1:] == pytest.approx((0.2, 0.0))


def test_turning_a_triangle_over_changes_no_distance() -> None:
    segments, corners = random_pairs(7, 500)
    difference = distances_of_pairs(segments, corners) - distances_of_pairs(segments, corners[:, ::-1])
    assert np.abs(difference).max() < ROUND_OFF
