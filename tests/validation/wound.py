"""References for a heavy cable over a fixed cylinder without friction, in the plane x-z, the cylinder's axis along y through the origin.

D is the distance that the axis of the cable keeps, the cylinder's radius and that of the cable. Both sides are written alike: x
runs away from the cylinder, s from where the cable lifts off at (D sin a, D cos a), slope -a of the tangent. n is the force
that the part beyond s exerts on the part before it, w the weight per length:

    x' = cos,   z' = sin,   n' = w e_z,   EI slope'' = n_x sin slope - n_z cos slope

On the cylinder the curvature is 1/D, so that no shear is left, and the cylinder presses with p = T/D + w cos(slope) [N/m], along the
normal, which leaves T - w z the same all along. Where the cable lifts off, curvature and tension go on and the shear jumps: the
cylinder pushes there with a force F >= 0 of its own [N]. Unknown are both angles a, both forces n and the length on one side; the
ends, the lift-offs and T - w z on both sides make as many conditions. A cable without bending has no F, and hangs in two catenaries.

Nothing is shared with the solver under test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import fsolve

Ends = tuple[tuple[float, float, float], tuple[float, float, float]]  # x [m], z [m] and slope [rad] at the end of either side


@dataclass(frozen=True)
class Wound:
    """A solved shape; sides are left and right, and x runs away from the cylinder on each."""

    distance: float  # m, D
    weight: float  # N/m
    free: tuple[float, float]  # m, length of either side
    angles: tuple[float, float]  # rad, from the top of the cylinder to where the cable lifts off
    forces: np.ndarray  # (2, 2) N, n_x and n_z where it lifts off
    paths: tuple[object, object]  # s (k,) from the lift-off [m] -> x and z (2, k) [m]

    @property
    def touched(self) -> tuple[float, float]:
        """Arc lengths [m] from the left end between which the cable lies on the cylinder."""
        return self.free[0], self.free[0] + self.distance * sum(self.angles)

    @property
    def tensions(self) -> np.ndarray:
        """(2,) [N] where the cable lifts off."""
        return np.array([n[0] * np.cos(a) - n[1] * np.sin(a) for n, a in zip(self.forces, self.angles, strict=True)])

    @property
    def lifts(self) -> np.ndarray:
        """(2,) [N] Force F of the cylinder where the cable lifts off."""
        return np.array([-(n[0] * np.sin(a) + n[1] * np.cos(a)) for n, a in zip(self.forces, self.angles, strict=True)])

    @property
    def push(self) -> np.ndarray:
        """(2,) [N] x and z of the whole force of the cylinder: both lift-offs, and p along the normal, by Gauss-Legendre quadrature."""
        left, right = self.angles
        points, weights = np.polynomial.legendre.leggauss(20)
        half = 0.5 * (left + right)
        angle = half * points + 0.5 * (right - left)
        tension = self.tensions[0] + self.weight * self.distance * (np.cos(angle) - np.cos(left))
        pressure = tension / self.distance + self.weight * np.cos(angle)
        spread = (self.distance * half * weights * pressure) @ np.column_stack([np.sin(angle), np.cos(angle)])
        ends = np.array([[-np.sin(left), np.cos(left)], [np.sin(right), np.cos(right)]])
        out: np.ndarray = spread + self.lifts @ ends
        return out

    def positions(self, s: np.ndarray) -> np.ndarray:
        """(k, 3) [m] Points of the axis by arc length from the left end."""
        first, last = self.touched
        angle = (s - first) / self.distance - self.angles[0]
        x, z = self.distance * np.sin(angle), self.distance * np.cos(angle)
        for side, sign, along in ((0, -1.0, first - s), (1, 1.0, s - last)):
            there = along > 0.0
            beyond = self.paths[side](along[there])  # type: ignore[operator]
            x[there], z[there] = sign * beyond[0], beyond[1]
        return np.column_stack([x, np.zeros_like(x), z])


def bent_over(*, bending: float, weight: float, length: float, distance: float, ends: Ends, guess: Wound) -> Wound:
    """The heavy elastica that lies on the cylinder between two clamps, by `solve_bvp`.

    Args:
        bending: [N m^2] EI.
        weight: [N/m].
        length: [m].
        distance: [m] D.
        ends: Of the left and the right side, x away from the cylinder.
        guess: To start from.
    """

    def side(y: np.ndarray, s: np.ndarray, size: float, n_x: float, n_z: float) -> np.ndarray:
        n = n_z + weight * size * s
        return size * np.vstack([np.cos(y[2]), np.sin(y[2]), y[3], (n_x * np.sin(y[2]) - n * np.cos(y[2])) / bending])

    def sizes(p: np.ndarray) -> tuple[float, float]:
        return p[6], length - p[6] - distance * (p[0] + p[1])

    def rhs(s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        left, right = sizes(p)
        return np.vstack([side(y[:4], s, left, p[2], p[3]), side(y[4:], s, right, p[4], p[5])])

    def conditions(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        lifted = [[distance * np.sin(angle), distance * np.cos(angle), -angle, -1.0 / distance] for angle in p[:2]]
        along = [
            n_x * np.cos(angle) - n_z * np.sin(angle) - weight * distance * np.cos(angle)
            for angle, n_x, n_z in (p[[0, 2, 3]], p[[1, 4, 5]])
        ]
        return np.concatenate([a[:4] - lifted[0], a[4:] - lifted[1], b[:3] - ends[0], b[4:7] - ends[1], [along[0] - along[1]]])

    s = np.linspace(0.0, 1.0, 401)
    rows = []
    for path, free in zip(guess.paths, guess.free, strict=True):
        x, z = path(s * free)  # type: ignore[operator]
        slope = np.arctan2(np.gradient(z), np.gradient(x))
        rows += [x, z, slope, np.gradient(slope, s * free)]
    p = np.array([*guess.angles, *guess.forces.ravel(), guess.free[0]])
    found = solve_bvp(rhs, conditions, s, np.vstack(rows), p=p, tol=1e-8, max_nodes=100_000)
    assert found.success, found.message
    p, free = found.p, sizes(found.p)
    paths = (lambda at: found.sol(np.asarray(at) / free[0])[:2], lambda at: found.sol(np.asarray(at) / free[1])[4:6])
    return Wound(distance, weight, free, (p[0], p[1]), p[2:6].reshape(2, 2), paths)


def hung_over(
    *, weight: float, length: float, distance: float, ends: tuple[tuple[float, float], tuple[float, float]], near: Wound | None = None
) -> Wound:
    """The cable without bending that hangs over the cylinder between two points: two catenaries, closed form but for five numbers.

    These are sought from those of a shape that is `near`.

    With H the horizontal force, n_z = -H tan a where it lifts off, a catenary is at s

        x = x_0 + H/w (asinh(v / H) - asinh(v_0 / H)),   z = z_0 + (sqrt(H^2 + v^2) - sqrt(H^2 + v_0^2)) / w,   v = v_0 + w s
    """

    def after(at: np.ndarray, angle: float, level: float) -> np.ndarray:
        v_0 = -level * np.tan(angle)
        v = v_0 + weight * at
        x = distance * np.sin(angle) + level / weight * (np.arcsinh(v / level) - np.arcsinh(v_0 / level))
        return np.array([x, distance * np.cos(angle) + (np.hypot(level, v) - np.hypot(level, v_0)) / weight])

    def misses(p: np.ndarray) -> np.ndarray:
        left, right, free = p[:2], p[2:4], p[4]
        other = length - free - distance * (left[0] + right[0])
        along = [level / np.cos(angle) - weight * distance * np.cos(angle) for angle, level in (left, right)]
        return np.concatenate([after(free, *left) - ends[0], after(other, *right) - ends[1], [along[0] - along[1]]])

    begin = [0.8, 0.6, 0.8, 0.6, 0.5 * (length - 1.6 * distance)]
    if near is not None:
        begin = [near.angles[0], near.forces[0, 0], near.angles[1], near.forces[1, 0], near.free[0]]
    p, _, flag, message = fsolve(misses, begin, full_output=True, xtol=1e-13)
    assert flag == 1, message
    assert np.abs(misses(p)).max() < 1e-12
    angles, free = (p[0], p[2]), (p[4], length - p[4] - distance * (p[0] + p[2]))
    forces = np.array([[level, -level * np.tan(angle)] for angle, level in (p[:2], p[2:4])])
    return Wound(distance, weight, free, angles, forces, (lambda s: after(s, *p[:2]), lambda s: after(s, *p[2:4])))
