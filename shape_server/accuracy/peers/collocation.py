"""The heavy, inextensible rod between two clamps as a boundary value problem for `scipy.integrate.solve_bvp`.

Lengths are in units of L, forces in units of EI / L^2. n is the force and m the moment that the part beyond s exerts on the part before
it, d3 the tangent and w = weight L^3 / EI. Equilibrium of a slice (Antman 2005, "Nonlinear problems of elasticity", 2nd ed., ch. VIII):

    r' = d3,   n = n0 + w s e_z,   m' = -d3 x n,   u = m + (EI / GJ - 1) (d3 . m) d3,   q' = 1/2 (u, 0) (x) q

with the unit quaternion q of the section and its rate of turning u in the world frame. In the plane x-z, with the slope a of the
tangent and the curvature k, this is x' = cos a, z' = sin a, a' = k, k' = n_x sin a - n_z cos a. The force n0 at s = 0 is a
parameter, so there are four states and two parameters in the plane, ten and three in space. Jacobians are in closed form.

Both the references (fine) and the peer that is timed (coarse) are made here; nothing is shared with the solver.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation

from .motions import LEVEL, Rod

AXES = np.eye(3)


@dataclass(frozen=True)
class Solved:
    """A shape found by collocation of fourth order."""

    found: Any  # what solve_bvp returned, in scaled units
    rod: Rod

    def positions(self, s: np.ndarray) -> np.ndarray:
        """(n, 3) [m] Points of the axis."""
        y = self.found.sol(s / self.rod.length) * self.rod.length
        return np.asarray(np.column_stack([y[0], np.zeros_like(s), y[1]]) if len(self.found.p) == 2 else y[:3].T)

    def frames(self, s: np.ndarray) -> np.ndarray:
        """(n, 4) Quaternions of the sections."""
        y = self.found.sol(s / self.rod.length)
        if len(self.found.p) == 2:
            return (Rotation.from_rotvec(np.outer(y[2], (0.0, -1.0, 0.0))) * LEVEL).as_quat()
        return np.ascontiguousarray((y[3:7] / np.linalg.norm(y[3:7], axis=0)).T)

    def forces(self) -> np.ndarray:
        """(2, 3) [N] Forces of the clamps on the rod."""
        n0 = self.found.p * self.rod.bending / self.rod.length**2
        first = np.array([n0[0], 0.0, n0[-1]]) if len(n0) == 2 else n0
        return np.array([-first, first + self.rod.weight * self.rod.length * AXES[2]])


@dataclass(frozen=True)
class Plane:
    """Rod and clamps in the plane x-z, as functions that `solve_bvp` calls; states x, z, a, k (4, n) and parameters n_x, n_z."""

    load: float  # w
    ends: np.ndarray  # (6,) x, z and slope of both clamps
    at_start: np.ndarray = field(default_factory=lambda: np.eye(6, 4) * (np.arange(6) < 3)[:, None])
    at_end: np.ndarray = field(default_factory=lambda: np.eye(6, 4, -3))

    @classmethod
    def of(cls, rod: Rod, position: np.ndarray, quaternion: np.ndarray) -> Plane:
        """Scaled, from clamps (2, 3) [m] and (2, 4)."""
        tangent = Rotation.from_quat(quaternion).apply(AXES[2])
        slope = np.arctan2(tangent[:, 2], tangent[:, 0])
        x, z = position[:, 0] / rod.length, position[:, 2] / rod.length
        return cls(rod.weight * rod.length**3 / rod.bending, np.array([x[0], z[0], slope[0], x[1], z[1], slope[1]]))

    def rate(self, s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        """(4, n) Derivatives of the states by s."""
        cos, sin = np.cos(y[2]), np.sin(y[2])
        return np.array([cos, sin, y[3], p[0] * sin - (p[1] + self.load * s) * cos])

    def rate_slopes(self, s: np.ndarray, y: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(4, 4, n) and (4, 2, n) Derivatives of the rates by states and parameters."""
        cos, sin = np.cos(y[2]), np.sin(y[2])
        by_state, by_parameter = np.zeros((4, 4, len(s))), np.zeros((4, 2, len(s)))
        by_state[0, 2], by_state[1, 2], by_state[2, 3] = -sin, cos, 1.0
        by_state[3, 2] = p[0] * cos + (p[1] + self.load * s) * sin
        by_parameter[3, 0], by_parameter[3, 1] = sin, -cos
        return by_state, by_parameter

    def miss(self, a: np.ndarray, b: np.ndarray, _p: np.ndarray) -> np.ndarray:
        """(6,) What the ends miss their clamps by."""
        return np.asarray(np.concatenate([a[:3], b[:3]]) - self.ends)

    def miss_slopes(self, _a: np.ndarray, _b: np.ndarray, _p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Its derivatives by both states and the parameters."""
        return self.at_start, self.at_end, np.zeros((6, 2))


@dataclass(frozen=True)
class Space:
    """Rod and clamps in space, as functions that `solve_bvp` calls; states r, q, m (10, n) and parameters n0 (3,)."""

    load: float  # w
    softer: float  # EI / GJ - 1
    places: np.ndarray  # (2, 3) of the clamps
    first: np.ndarray  # (4,) quaternion of the first clamp
    turned: np.ndarray  # (3, 4) times q is the vector part of conj(q of the last clamp) (x) q

    @classmethod
    def of(cls, rod: Rod, position: np.ndarray, quaternion: np.ndarray) -> Space:
        """Scaled, from clamps (2, 3) [m] and (2, 4)."""
        last = quaternion[1]
        turned = np.column_stack([last[3] * AXES - _cross(last[:3]), -last[:3]])
        return cls(rod.weight * rod.length**3 / rod.bending, rod.bending / rod.twist - 1, position / rod.length, quaternion[0], turned)

    def rate(self, s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        """(10, n) Derivatives of the states by s."""
        x, z, w, e = y[3:7]
        m, d3 = y[7:], _tangent(y[3:7])
        a, b, c = m + self.softer * (d3 * m).sum(0) * d3
        n_x, n_y, n_z = p[0], p[1], p[2] + self.load * s
        turn = 0.5 * np.array([e * a + b * w - c * z, e * b + c * x - a * w, e * c + a * z - b * x, -(a * x + b * z + c * w)])
        return np.concatenate([d3, turn, [d3[2] * n_y - d3[1] * n_z, d3[0] * n_z - d3[2] * n_x, d3[1] * n_x - d3[0] * n_y]])

    def rate_slopes(self, s: np.ndarray, y: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(10, 10, n) and (10, 3, n) Derivatives of the rates by states and parameters."""
        x, z, w, e = y[3:7]
        m, d3, none = y[7:], _tangent(y[3:7]), np.zeros_like(x)
        n = np.array([p[0] + none, p[1] + none, p[2] + self.load * s])
        twisting = (d3 * m).sum(0)
        a, b, c = m + self.softer * twisting * d3
        d3_by_q = 2 * np.array([[w, e, x, z], [-e, w, z, -x], [-2 * x, -2 * z, none, none]])  # (3, 4, n)
        u_by_m = AXES[:, :, None] + self.softer * d3[:, None] * d3[None]  # (3, 3, n)
        u_by_q = self.softer * (twisting * d3_by_q + d3[:, None] * np.einsum("in,ijn->jn", m, d3_by_q))  # (3, 4, n)
        turn_by_u = 0.5 * np.array([[e, w, -z], [-w, e, x], [z, -x, e], [-x, -z, -w]])  # (4, 3, n)
        turn_by_q = 0.5 * np.array([[none, -c, b, a], [c, none, -a, b], [-b, a, none, c], [-a, -b, -c, none]])  # (4, 4, n)
        by_state, by_parameter = np.zeros((10, 10, len(s))), np.zeros((10, 3, len(s)))
        by_state[:3, 3:7] = d3_by_q
        by_state[3:7, 3:7] = turn_by_q + np.einsum("ijn,jkn->ikn", turn_by_u, u_by_q)
        by_state[3:7, 7:] = np.einsum("ijn,jkn->ikn", turn_by_u, u_by_m)
        by_state[7:, 3:7] = np.einsum("ijn,jkn->ikn", _cross(n), d3_by_q)
        by_parameter[7:] = -_cross(d3)
        return by_state, by_parameter

    def miss(self, a: np.ndarray, b: np.ndarray, _p: np.ndarray) -> np.ndarray:
        """(13,) What the ends miss their clamps by."""
        return np.concatenate([a[:3] - self.places[0], a[3:7] - self.first, b[:3] - self.places[1], self.turned @ b[3:7]])

    def miss_slopes(self, _a: np.ndarray, _b: np.ndarray, _p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Its derivatives by both states and the parameters."""
        at_start, at_end = np.zeros((13, 10)), np.zeros((13, 10))
        at_start[:7, :7] = np.eye(7)
        at_end[7:10, :3], at_end[10:, 3:7] = AXES, self.turned
        return at_start, at_end, np.zeros((13, 3))


def collocate(problem: Plane | Space, mesh: np.ndarray, y: np.ndarray, p: np.ndarray, tolerance: float, *, nodes_max: int) -> Any:
    """What `solve_bvp` returns, whether it met its tolerance or not.

    Args:
        problem: Rod and clamps.
        mesh: (n,) Arc lengths from 0 to 1.
        y: States on the mesh to start from.
        p: Parameters to start from.
        tolerance: Relative residual; the mesh is refined until it is met, or would exceed `nodes_max`.
        nodes_max: Largest number of nodes.
    """
    return solve_bvp(
        problem.rate, problem.miss, mesh, y, p, tol=tolerance, fun_jac=problem.rate_slopes, bc_jac=problem.miss_slopes, max_nodes=nodes_max
    )


def _tangent(q: np.ndarray) -> np.ndarray:
    x, z, w, e = q  # e is the scalar part
    return np.array([2 * (x * w + z * e), 2 * (z * w - x * e), 1 - 2 * (x * x + z * z)])


def _cross(v: np.ndarray) -> np.ndarray:
    """(3, 3, ...) The matrix of v x."""
    none = np.zeros_like(v[0])
    return np.array([[none, -v[2], v[1]], [v[2], none, -v[0]], [-v[1], v[0], none]])
