"""Reference for a heavy rod in space whose curvature has a micro-structure length, by `scipy.integrate.solve_bvp` with seventeen states.

Force n and moment m are those that the part beyond s exerts on the part before it. With d1, d2, d3 the axes of the section, w the weight
per length, z up, e = kappa - kappa_0 the two parts of curvature less the natural ones, and W = (e . K e + l^2 e' . K e' + GJ tau^2) / 2,

    r' = d3,   n' = w e_z,   m' = -d3 x n,   (m.d1, m.d2) = K e - D',   m.d3 = GJ tau,   D = l^2 K e'        [N, N m, N m^2]

(Papargyri-Beskou et al. 2003, Int. J. Solids Struct. 40, 385-400, for the straight beam; Antman 2005, "Nonlinear problems of elasticity",
2nd ed., ch. VIII). Neither n.d3 + m.kappa + D.e' - W - w z, which is constant along a uniform rod, nor the derivative of the energy with
the place of an end, which is the force there, is used to solve it. Nothing is shared with the solver under test.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation

TOLERANCE = 1e-8  # of solve_bvp, relative residual per interval; keeps the integral to 2e-11 N, and 1e-10 runs out of nodes


@dataclass(frozen=True)
class Law:
    """One metre of rod."""

    bending: tuple[float, float]  # N m^2, about d1 and d2
    twist: float  # N m^2
    micro: float  # m
    weight: float = 1.0  # N/m
    natural: tuple[float, float] = (0.0, 0.0)  # 1/m, about d1 and d2


@dataclass(frozen=True)
class Exact:
    """A solved shape."""

    law: Law
    state: Callable[[np.ndarray], np.ndarray]  # s -> (17, k): position [m], quaternion, n [N], m [N m], e [1/m], l e' [1/m]

    def positions(self, s: np.ndarray) -> np.ndarray:
        """(k, 3) [m] Points of the axis."""
        return self.state(s)[:3].T

    def frames(self, s: np.ndarray) -> np.ndarray:
        """(k, 4) Quaternions along the axis."""
        q = self.state(s)[3:7]
        return np.ascontiguousarray((q / np.linalg.norm(q, axis=0)).T)

    def wrenches(self) -> np.ndarray:
        """(2, 6) [N, N m] On the rod at both ends."""
        return self.state(np.array([0.0, 1.0]))[7:13].T * np.array([[-1.0], [1.0]])

    def curvature(self, s: np.ndarray) -> np.ndarray:
        """(k,) [1/m]."""
        return np.linalg.norm(self.state(s)[13:15] + np.array(self.law.natural)[:, None], axis=0)

    def densities(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Energy per metre (k,) [N], weight with it, and the integral that stays constant (k,) [N]."""
        y, law = self.state(s), self.law
        axes = Rotation.from_quat(self.frames(s)).as_matrix()  # columns are the axes
        m = np.einsum("kxi,xk->ik", axes, y[10:13])
        tau, K = m[2] / law.twist, np.array(law.bending)[:, None]
        e, de = y[13:15], y[15:17]  # (l e')^2 K = l^2 e'^2 K
        stored = 0.5 * ((K * e**2).sum(0) + (K * de**2).sum(0) + law.twist * tau**2)
        bent = e + np.array(law.natural)[:, None]
        pulled = np.einsum("kx,xk->k", axes[:, :, 2], y[7:10])
        constant = pulled + (m[:2] * bent).sum(0) + m[2] * tau + (K * de**2).sum(0) - stored - law.weight * y[2]
        return stored + law.weight * y[2], constant

    def energy(self) -> float:
        """[J] By Gauss-Legendre quadrature on 200 panels."""
        points, weights = np.polynomial.legendre.leggauss(6)
        edges = np.linspace(0.0, 1.0, 201)
        half = np.diff(edges) / 2
        s = (edges[:-1] + half)[:, None] + half[:, None] * points
        return float((half * (self.densities(s.ravel())[0].reshape(s.shape) @ weights)).sum())


def solved(
    law: Law,
    begin: tuple[np.ndarray, np.ndarray],
    end: tuple[np.ndarray, np.ndarray | None],
    guess: Callable[[np.ndarray], np.ndarray],
    mesh: np.ndarray,
) -> Exact:
    """The rod clamped at s = 0, and clamped or hinged at s = 1.

    Args:
        law: What it is made of.
        begin: Position [m] and quaternion at s = 0.
        end: The same at s = 1; no quaternion at a hinge.
        guess: s -> (17, k) States to start from.
        mesh: (k,) [m] Arc lengths to start from.
    """
    K, natural, l = np.array(law.bending)[:, None], np.array(law.natural)[:, None], law.micro

    def rhs(s: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, z, w, r = y[3:7]  # the quaternion's parts
        d1 = np.array([1 - 2 * (z * z + w * w), 2 * (x * z + w * r), 2 * (x * w - z * r)])
        d2 = np.array([2 * (x * z - w * r), 1 - 2 * (x * x + w * w), 2 * (z * w + x * r)])
        d3 = np.array([2 * (x * w + z * r), 2 * (z * w - x * r), 1 - 2 * (x * x + z * z)])
        n, m, e, de = y[7:10], y[10:13], y[13:15], y[15:17]
        u = np.vstack([e + natural, (d3 * m).sum(0) / law.twist])
        q = 0.5 * np.array(
            [
                r * u[0] + z * u[2] - w * u[1],
                r * u[1] + w * u[0] - x * u[2],
                r * u[2] + x * u[1] - z * u[0],
                -(x * u[0] + z * u[1] + w * u[2]),
            ]
        )
        force = np.zeros_like(d3)
        force[2] = law.weight
        inner = np.array([(d1 * m).sum(0), (d2 * m).sum(0)])
        return np.vstack([d3, q, force, -np.cross(d3, n, axis=0), de / l, (e - inner / K) / l])

    def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        last = b[10:13] if end[1] is None else (Rotation.from_quat(end[1]).inv() * Rotation.from_quat(b[3:7])).as_quat()[:3]
        return np.concatenate([a[:3] - begin[0], a[3:7] - begin[1], b[:3] - end[0], last, a[15:], b[15:]])

    found = solve_bvp(rhs, ends, mesh, guess(mesh), tol=TOLERANCE, max_nodes=200_000)
    assert found.success, found.message
    return Exact(law, found.sol)
