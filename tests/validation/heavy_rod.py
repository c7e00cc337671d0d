"""Reference for a heavy inextensible rod in space, by `scipy.integrate.solve_bvp` with thirteen states.

The equations are those of `heavy_elastica`, with a quaternion for the frame of the section; Antman 2005, "Nonlinear problems of
elasticity", 2nd ed., ch. VIII.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class Spatial:
    """A solved shape in space."""

    state: Callable[[np.ndarray], np.ndarray]  # s -> (13, k): position [m], quaternion, force [N], moment [N m]
    length: float  # m
    load: float  # N, end force by which forces are scaled

    def positions(self, s: np.ndarray) -> np.ndarray:
        """(k, 3) [m] Points of the axis."""
        return self.state(s)[:3].T

    def frames(self, s: np.ndarray) -> np.ndarray:
        """(k, 4) Quaternions along the axis."""
        q = self.state(s)[3:7]
        return np.ascontiguousarray((q / np.linalg.norm(q, axis=0)).T)

    def wrenches(self) -> np.ndarray:
        """(2, 6) [N, N m] On the rod at both ends."""
        n_m = self.state(np.array([0.0, self.length]))[7:].T
        return n_m * np.array([[-1.0], [1.0]])


def spatial(
    *,
    bending: float,
    twist: float,
    weight: float,
    length: float,
    end: tuple[np.ndarray, np.ndarray],
    begin: tuple[np.ndarray, np.ndarray],
    guess: Callable[[np.ndarray], np.ndarray],
) -> Spatial:
    """The heavy Kirchhoff rod clamped at both ends, thirteen states: r, q, n, m in the world frame.

    q' = q (x) (0, u) / 2 with u = R^T m / (EI, EI, GJ) in the frame of the section.

    Args:
        bending: [N m^2] EI.
        twist: [N m^2] GJ.
        weight: [N/m].
        length: [m].
        begin: Position [m] and quaternion at s = 0.
        end: The same at s = length.
        guess: s -> (13, k) States to start from.
    """
    one = bending / length**2  # N
    unit = np.array([length] * 3 + [1.0] * 4 + [one] * 3 + [one * length] * 3)[:, None]
    last = np.asarray(end[1])

    def rhs(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, z, w, e = y[3], y[4], y[5], y[6]  # the quaternion's parts
        d1 = np.array([1 - 2 * (z * z + w * w), 2 * (x * z + w * e), 2 * (x * w - z * e)])
        d2 = np.array([2 * (x * z - w * e), 1 - 2 * (x * x + w * w), 2 * (z * w + x * e)])
        d3 = np.array([2 * (x * w + z * e), 2 * (z * w - x * e), 1 - 2 * (x * x + z * z)])
        m = y[10:]
        u = np.array([(d1 * m).sum(0), (d2 * m).sum(0), (d3 * m).sum(0) * bending / twist])
        q = 0.5 * np.array(
            [
                e * u[0] + z * u[2] - w * u[1],
                e * u[1] + w * u[0] - x * u[2],
                e * u[2] + x * u[1] - z * u[0],
                -(x * u[0] + z * u[1] + w * u[2]),
            ]
        )
        force = np.zeros_like(d3)
        force[2] = weight * length / one
        return np.vstack([d3, q, force, -np.cross(d3, y[7:10], axis=0)])

    def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        turn = Rotation.from_quat(last).inv() * Rotation.from_quat(b[3:7])
        return np.concatenate(
            [a[:3] - np.asarray(begin[0]) / length, a[3:7] - begin[1], b[:3] - np.asarray(end[0]) / length, turn.as_quat()[:3]]
        )

    s = np.linspace(0.0, 1.0, 201)
    found = solve_bvp(rhs, ends, s, guess(s * length) / unit, tol=1e-9, max_nodes=100_000)
    assert found.success, found.message
    return Spatial(lambda at: found.sol(np.asarray(at) / length) * unit, length, one)
