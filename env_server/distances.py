"""Closest points between points, segments and triangles, exact in float64.

All functions are plain functions on triples of floats [m], compiled by numba on first use and kept on disk. Fractions
run from 0 at the first end of a segment to 1 at its second. Nothing here knows an inside or an outside: a distance is
never negative, and zero where a segment crosses a triangle.

Degenerate input is allowed: a segment may be a point, a triangle may be a segment or a point. Formulas after
Ericson 2005, "Real-Time Collision Detection", sections 5.1.2, 5.1.5 and 5.1.9; where two segments are so nearly
parallel that the formula loses its digits, the four projections of an end onto the other segment are compared as well.

Numba looks at the age of the file a kernel stands in, not at the files it calls into: after a change here, delete the
`__pycache__` of this folder, or `touch.py` goes on with the old formulas.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

import numpy as np
from numba import njit

Triple = tuple[float, float, float]
Function = TypeVar("Function", bound=Callable[..., object])

OPTIONS: Final[dict[str, Any]] = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": True}
POINT: Final = 1e-30  # m^2, squared length below which a segment counts as a point
PARALLEL: Final = 1e-8  # squared sine of the angle below which two segments count as nearly parallel
ROUNDING: Final = 1e-12  # m, what rounding may do to a coordinate; overlap of neighbouring features, so that no gap opens


def kernel(function: Function) -> Function:
    """Compile on first use, without an entry point for C; division by zero gives infinity, as in numpy."""
    compiled: Any = njit(**OPTIONS)(function)
    return cast(Function, compiled)


def leaf(function: Function) -> Function:
    """Compile what makes no array and returns none: it counts no references, which takes as long as the arithmetic does."""
    compiled: Any = njit(**{**OPTIONS, "_nrt": False})(function)
    return cast(Function, compiled)


def inlined(function: Function) -> Function:
    """Compile as a leaf, into its callers: for what is called in one place and gets more than a handful of numbers handed over."""
    compiled: Any = njit(**{**OPTIONS, "_nrt": False, "forceinline": True})(function)
    return cast(Function, compiled)


def fixed(array: np.ndarray, kind: type = np.float64) -> np.ndarray:
    """The array, read-only always: numba compiles anew for arrays that may be written to and those that may not."""
    view: np.ndarray = np.ascontiguousarray(array, dtype=kind).view()
    view.setflags(write=False)
    return view


@leaf
def row(rows: np.ndarray, index: int) -> Triple:
    """Row of a (m, 3) array as a triple."""
    # A triple stays in registers; a view of the array would count references with atomic instructions.
    return (rows[index, 0], rows[index, 1], rows[index, 2])


@leaf
def minus(a: Triple, b: Triple) -> Triple:
    """Difference a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@leaf
def ahead(a: Triple, direction: Triple, fraction: float) -> Triple:
    """Point a + fraction * direction."""
    return (a[0] + fraction * direction[0], a[1] + fraction * direction[1], a[2] + fraction * direction[2])


@leaf
def dot(a: Triple, b: Triple) -> float:
    """Scalar product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@leaf
def cross(a: Triple, b: Triple) -> Triple:
    """Vector product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@leaf
def point_segment(point: Triple, start: Triple, end: Triple) -> float:
    """Fraction along the segment of its point closest to `point`."""
    along = minus(end, start)
    square = dot(along, along)
    if square < POINT:
        return 0.0
    return min(max(dot(minus(point, start), along) / square, 0.0), 1.0)


@leaf
def squared_gap(a: Triple, along_a: Triple, t: float, b: Triple, along_b: Triple, u: float) -> float:
    """Squared distance between a + t along_a and b + u along_b, in m^2."""
    apart = minus(ahead(a, along_a, t), ahead(b, along_b, u))
    return dot(apart, apart)


@leaf
def segment_segment(a0: Triple, a1: Triple, b0: Triple, b1: Triple) -> tuple[float, float]:
    """Fractions (t, u) along a and b of their closest points.

    Unclamped, t = ((a.b)(b.w) - (a.w)(b.b)) / |a x b|^2 with w = a0 - b0; then u is clamped and t follows from it.
    Of the many closest points of parallel segments, an end of the common stretch is taken.
    """
    a, b, apart = minus(a1, a0), minus(b1, b0), minus(a0, b0)
    aa, bb, ab = dot(a, a), dot(b, b), dot(a, b)
    if aa < POINT or bb < POINT:
        t = point_segment(b0, a0, a1)
        return t, point_segment(ahead(a0, a, t), b0, b1)
    normal = cross(a, b)
    sine = dot(normal, normal)
    t, u = 0.0, 0.0
    if sine > 0.0:
        t = min(max((ab * dot(b, apart) - dot(a, apart) * bb) / sine, 0.0), 1.0)
    u = min(max((ab * t + dot(b, apart)) / bb, 0.0), 1.0)
    t = min(max((ab * u - dot(a, apart)) / aa, 0.0), 1.0)
    if sine > PARALLEL * aa * bb:
        return t, u
    nearest = squared_gap(a0, a, t, b0, b, u)
    for side in range(4):
        if side < 2:
            t_end, u_end = float(side), point_segment(a0 if side == 0 else a1, b0, b1)
        else:
            t_end, u_end = point_segment(b0 if side == 2 else b1, a0, a1), float(side - 2)
        distance = squared_gap(a0, a, t_end, b0, b, u_end)
        if distance < nearest:
            nearest, t, u = distance, t_end, u_end
    return t, u


@leaf
def is_over(point: Triple, a: Triple, b: Triple, c: Triple, normal: Triple) -> bool:
    """Does the point, moved along the normal of triangle (a, b, c), land inside it or on its rim?"""
    return (
        dot(cross(minus(b, a), minus(point, a)), normal) >= 0.0
        and dot(cross(minus(c, b), minus(point, b)), normal) >= 0.0
        and dot(cross(minus(a, c), minus(point, c)), normal) >= 0.0
    )


@leaf
def point_triangle(point: Triple, a: Triple, b: Triple, c: Triple) -> Triple:
    """Point of triangle (a, b, c) closest to `point`."""
    normal = cross(minus(b, a), minus(c, a))
    square = dot(normal, normal)
    best, nearest = a, np.inf
    for side in range(3):
        start = a if side == 0 else (b if side == 1 else c)
        along = minus(b if side == 0 else (c if side == 1 else a), start)
        candidate = ahead(start, along, point_segment(point, start, ahead(start, along, 1.0)))
        apart = minus(point, candidate)
        if dot(apart, apart) < nearest:
            best, nearest = candidate, dot(apart, apart)
    if square > 0.0 and is_over(point, a, b, c, normal):
        height = dot(minus(point, a), normal)
        # Compared with the rim's distance because the normal of a sliver has few correct digits.
        if height * height / square < nearest:
            best = ahead(point, normal, -height / square)
    return best


@leaf
def segment_triangle(start: Triple, end: Triple, a: Triple, b: Triple, c: Triple) -> tuple[float, Triple]:
    """Fraction along the segment and point of the triangle (a, b, c) that are closest to each other.

    The closest pair is a crossing, an end of the segment with the triangle, or the segment with a side.
    """
    along = minus(end, start)
    normal = cross(minus(b, a), minus(c, a))
    height_start, height_end = dot(minus(start, a), normal), dot(minus(end, a), normal)
    if (height_start < 0.0) != (height_end < 0.0):
        fraction = height_start / (height_start - height_end)
        crossing = ahead(start, along, fraction)
        if is_over(crossing, a, b, c, normal):
            return fraction, crossing
    best_fraction, best_point, nearest = 0.0, a, np.inf
    for side in range(5):
        if side < 2:
            fraction = float(side)
            point = point_triangle(start if side == 0 else end, a, b, c)
        else:
            first = a if side == 2 else (b if side == 3 else c)
            second = b if side == 2 else (c if side == 3 else a)
            fraction, u = segment_segment(start, end, first, second)
            point = ahead(first, minus(second, first), u)
        apart = minus(ahead(start, along, fraction), point)
        if dot(apart, apart) < nearest:
            best_fraction, best_point, nearest = fraction, point, dot(apart, apart)
    return best_fraction, best_point


@leaf
def point_box(point: Triple, box: np.ndarray) -> float:
    """Distance in m from a point to a box (6,) of least and greatest corner; zero inside."""
    square = 0.0
    for axis in range(3):
        square += max(box[axis] - point[axis], point[axis] - box[axis + 3], 0.0) ** 2
    return float(square**0.5)


@leaf
def is_in_cone(away: Triple, distance: float, rows: np.ndarray, first: int, last: int) -> bool:
    """Is away . row <= 0 for rows first to last, to within a nanoradian and a picometre?"""
    slack = 1e-9 * distance + ROUNDING
    for index in range(first, last):  # noqa: SIM110 (numba compiles no generator here)
        if dot(away, row(rows, index)) > slack:
            return False
    return True


@leaf
def length(a: Triple) -> float:
    """Length |a|."""
    return float(dot(a, a) ** 0.5)


@leaf
def total_and_shortest(nodes: np.ndarray, poses: np.ndarray) -> tuple[float, float]:
    """Sum of all numbers of nodes (n, 3) and poses (b, 7), and length of the shortest quaternion, infinite without one."""
    total, shortest = 0.0, np.inf
    for index in range(len(nodes)):
        total += nodes[index, 0] + nodes[index, 1] + nodes[index, 2]
    for index in range(len(poses)):
        x, y, z, w = poses[index, 3], poses[index, 4], poses[index, 5], poses[index, 6]
        total += poses[index, 0] + poses[index, 1] + poses[index, 2] + x + y + z + w
        shortest = min(shortest, (x * x + y * y + z * z + w * w) ** 0.5)
    return total, shortest


@leaf
def rotation(pose: np.ndarray) -> tuple[Triple, Triple, Triple]:
    """Axes of a body with pose (7,) in the world, from its quaternion x, y, z, w in places 3 to 6."""
    x, y, z, w = pose[3], pose[4], pose[5], pose[6]
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return (
        (1.0 - s * (y * y + z * z), s * (x * y + z * w), s * (x * z - y * w)),
        (s * (x * y - z * w), 1.0 - s * (x * x + z * z), s * (y * z + x * w)),
        (s * (x * z + y * w), s * (y * z - x * w), 1.0 - s * (x * x + y * y)),
    )


@leaf
def turned(axes: tuple[Triple, Triple, Triple], a: Triple) -> Triple:
    """Vector a of the body's frame in the world's."""
    return ahead(ahead(ahead((0.0, 0.0, 0.0), axes[0], a[0]), axes[1], a[1]), axes[2], a[2])


@leaf
def turned_back(axes: tuple[Triple, Triple, Triple], a: Triple) -> Triple:
    """Vector a of the world's frame in the body's."""
    return (dot(axes[0], a), dot(axes[1], a), dot(axes[2], a))
