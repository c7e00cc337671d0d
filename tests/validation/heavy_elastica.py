"""References for a heavy inextensible rod, by `scipy.integrate.solve_bvp` on equations of their own.

The section at arc length s carries the force n and the moment m that the part beyond s exerts on the part before it.
With w the weight per length and z up, equilibrium of a slice is

    r' = d3,   n' = w e_z,   m' = -r' x n,   m = EI (d3 x d3') + GJ tau d3        [N, N m]

(Antman 2005, "Nonlinear problems of elasticity", 2nd ed., ch. VIII; straight in its natural state). In the plane
x-z with the slope theta of the tangent this is x' = cos, z' = sin, EI theta'' = n_x sin - n_z cos.
Nothing is shared with the solver under test: it works with quaternions of segments and a staggered mesh, these with
continuous states and a collocation of fourth order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp

TOLERANCE = 1e-10  # of solve_bvp, relative residual per interval


@dataclass(frozen=True)
class Planar:
    """A solved shape in the plane x-z."""

    state: Callable[[np.ndarray], np.ndarray]  # s -> (4, k): x [m], z [m], slope [rad], curvature [1/m]
    bending: float  # N m^2
    weight: float  # N/m
    length: float  # m
    force: np.ndarray  # (2,) N, internal force (n_x, n_z) at s = 0

    def positions(self, s: np.ndarray) -> np.ndarray:
        """(k, 3) [m] Points of the axis."""
        x, z = self.state(s)[:2]
        return np.column_stack([x, np.zeros_like(x), z])

    def energy(self) -> float:
        """[J] Elastic energy plus potential energy of the weight, by Gauss-Legendre quadrature on 200 panels."""
        points, weights = np.polynomial.legendre.leggauss(6)
        edges = np.linspace(0.0, self.length, 201)
        half = np.diff(edges) / 2
        s = (edges[:-1] + half)[:, None] + half[:, None] * points  # (200, 6)
        _, z, _, curvature = self.state(s.ravel())
        density = (self.bending / 2 * curvature**2 + self.weight * z).reshape(s.shape)
        return float((half * (density @ weights)).sum())


def planar(
    *,
    bending: float,
    weight: float,
    length: float,
    start: tuple[float, float, float],
    end: tuple[float | None, float | None, float | None],
    guess: Planar | None = None,
    slope: Callable[[np.ndarray], np.ndarray] | None = None,
    force: tuple[float, float] = (0.0, 0.0),
) -> Planar:
    """The heavy planar elastica between two ends.

    Args:
        bending: [N m^2] EI.
        weight: [N/m] w.
        length: [m].
        start: x [m], z [m] and slope [rad] at s = 0.
        end: The same at s = length; None where it is free: then the force, or the curvature, is zero there.
        guess: A solved neighbour to start from.
        slope: [rad] Without a neighbour: slope along s to start from.
        force: [N] Without a neighbour: force at s = 0 to start from.

    Source:
        Scaled by length and EI, which turns the load into w L^3 / EI.
    """
    load = weight * length**3 / bending
    unit = bending / length**2

    def rhs(s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.vstack([np.cos(y[2]), np.sin(y[2]), y[3], p[0] * np.sin(y[2]) - (p[1] + load * s) * np.cos(y[2])])

    def ends(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.array(
            [
                a[0] - start[0] / length,
                a[1] - start[1] / length,
                a[2] - start[2],
                p[0] if end[0] is None else b[0] - end[0] / length,
                p[1] + load if end[1] is None else b[1] - end[1] / length,
                b[3] if end[2] is None else b[2] - end[2],
            ]
        )

    s = np.linspace(0.0, 1.0, 401)
    if guess is not None:
        y = guess.state(s * length) / np.array([length, length, 1.0, 1 / length])[:, None]
        p = guess.force / unit
    else:
        angle = np.interp(s, [0, 1], [start[2], end[2] or 0.0]) if slope is None else slope(s * length)
        step = np.diff(s)
        middle = (angle[1:] + angle[:-1]) / 2
        x = start[0] / length + np.append(0.0, np.cumsum(np.cos(middle) * step))
        z = start[1] / length + np.append(0.0, np.cumsum(np.sin(middle) * step))
        y, p = np.vstack([x, z, angle, np.gradient(angle, s)]), np.array(force) / unit
    found = solve_bvp(rhs, ends, s, y, p=p, tol=TOLERANCE, max_nodes=200_000)
    assert found.success, found.message
    scale = np.array([length, length, 1.0, 1 / length])[:, None]
    return Planar(lambda at: found.sol(np.asarray(at) / length) * scale, bending, weight, length, found.p * unit)


@dataclass(frozen=True)
class Draped:
    """A solved shape in the plane x-z that lies over one frictionless edge."""

    before: Planar  # up to the edge
    after: Planar  # beyond it; its s = 0 is the touched point
    touch: float  # m, arc length of the touched point
    push: np.ndarray  # (2,) N, force (x, z) of the edge on the cable

    def positions(self, s: np.ndarray) -> np.ndarray:
        """(k, 3) [m] Points of the axis."""
        first = self.before.positions(np.minimum(s, self.touch))
        return np.where((s < self.touch)[:, None], first, self.after.positions(np.maximum(s - self.touch, 0.0)))


def draped(
    *,
    bending: float,
    weight: float,
    length: float,
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    edge: tuple[float, float],
    distance: float,
    guess: tuple[np.ndarray, np.ndarray, np.ndarray],
    touch: float,
    force: tuple[float, float],
    push: float,
) -> Draped:
    """The heavy planar elastica between two clamps over an edge without friction.

    Both pieces are scaled to the unit interval. At the edge the cable's axis is `distance` from it along the normal of the
    axis, position, slope and curvature are continuous, and the force jumps along that normal by what the edge pushes.

    Args:
        bending: [N m^2] EI.
        weight: [N/m].
        length: [m].
        start: x [m], z [m] and slope [rad] at s = 0.
        end: The same at s = length.
        edge: [m] x and z of the edge, which runs along y.
        distance: [m] Between axis and edge.
        guess: Arc lengths [m] with positions (k, 3) [m] and slopes [rad] to start from.
        touch: [m] Arc length of the touched point, to start from.
        force: [N] Internal force (x, z) at s = 0, to start from.
        push: [N] To start from.
    """
    load, one = weight * length**3 / bending, bending / length**2

    def piece(y: np.ndarray, size: float, s: np.ndarray, n_x: float, n_z: float) -> list[np.ndarray]:
        n = n_z + load * s
        return [size * np.cos(y[2]), size * np.sin(y[2]), size * y[3], size * (n_x * np.sin(y[2]) - n * np.cos(y[2]))]

    def rhs(s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        n_x, n_z, pushed, at, lift = p
        first = piece(y[:4], at, at * s, n_x, n_z)
        return np.vstack(first + piece(y[4:], 1 - at, at + (1 - at) * s, n_x + pushed * np.sin(lift), n_z - pushed * np.cos(lift)))

    def ends(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        lift, far = p[4], distance / length
        over = np.array([edge[0] / length - far * np.sin(lift), edge[1] / length + far * np.cos(lift)])
        clamps = [
            a[0] - start[0] / length,
            a[1] - start[1] / length,
            a[2] - start[2],
            b[4] - end[0] / length,
            b[5] - end[1] / length,
            b[6] - end[2],
        ]
        return np.concatenate([clamps, b[:4] - a[4:], b[:2] - over, [b[2] - lift]])

    unit = np.linspace(0.0, 1.0, 401)
    at, places, slopes = guess

    def rough(s: np.ndarray) -> np.ndarray:
        slope = np.interp(s, at, slopes)
        x, z = (np.interp(s, at, places[:, axis]) / length for axis in (0, 2))
        return np.vstack([x, z, slope, np.gradient(slope, s / length)])

    y = np.vstack([rough(unit * touch), rough(touch + unit * (length - touch))])
    p = np.array([force[0] / one, force[1] / one, push / one, touch / length, np.interp(touch, at, slopes)])
    found = solve_bvp(rhs, ends, unit, y, p=p, tol=1e-9, max_nodes=100_000)
    assert found.success, found.message
    n_x, n_z, pushed, part, lift = found.p
    scale = np.array([length, length, 1.0, 1 / length])[:, None]
    split = part * length

    def before(s: np.ndarray) -> np.ndarray:
        return found.sol(np.asarray(s) / split)[:4] * scale

    def after(s: np.ndarray) -> np.ndarray:
        return found.sol(np.asarray(s) / (length - split))[4:] * scale

    thrust = pushed * one * np.array([-np.sin(lift), np.cos(lift)])
    first = np.array([n_x, n_z]) * one
    second = first + np.array([0.0, weight * split]) - thrust
    return Draped(Planar(before, bending, weight, split, first), Planar(after, bending, weight, length - split, second), split, thrust)


def lifted(*, bending: float, weight: float, length: float, height: float, chord: float) -> tuple[Planar, float, float]:
    """The heavy planar elastica clamped level at a height, whose far part lies on a floor up to its level far end.

    The rod leaves the floor with no slope and no curvature, at an arc length that is part of the solution.

    Args:
        bending: [N m^2] EI.
        weight: [N/m].
        length: [m].
        height: [m] Of the clamp over the rod that lies.
        chord: [m] Horizontal distance of both ends.

    Returns:
        The lifted part from the clamp down, its length [m], and the force [N] of the floor at the point of lift-off.
    """
    load, one = weight * length**3 / bending, bending / length**2

    def rhs(s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        n = p[1] + load * p[2] * s
        return p[2] * np.vstack([np.cos(y[2]), np.sin(y[2]), y[3], p[0] * np.sin(y[2]) - n * np.cos(y[2])])

    def ends(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.array([a[0], a[1] - height / length, a[2], b[0] + 1 - p[2] - chord / length, b[1], b[2], b[3]])

    part = (72 * bending * height / weight) ** 0.25 / length  # of the beam with small slopes
    s = np.linspace(0.0, 1.0, 201)
    away = part * (1 - s)
    fall = load * (part * away**3 / 18 - away**4 / 24)
    y = np.vstack([part * s, fall, -load * (part * away**2 / 6 - away**3 / 6), load * (part * away / 3 - away**2 / 2)])
    found = solve_bvp(rhs, ends, s, y, p=np.array([0.0, -load * part * 2 / 3, part]), tol=TOLERANCE, max_nodes=100_000)
    assert found.success, found.message
    n_x, n_z, part = found.p
    scale = np.array([length, length, 1.0, 1 / length])[:, None]
    free = part * length
    shape = Planar(lambda at: found.sol(np.asarray(at) / free) * scale, bending, weight, free, np.array([n_x, n_z]) * one)
    return shape, free, float(n_z * one + weight * free)
