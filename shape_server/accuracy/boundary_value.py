"""Independent references of rods: the boundary value problem of Kirchhoff and Cosserat, collocated by `scipy.integrate.solve_bvp`.

Lengths in units of the cable's length L, forces of EI / L^2, EI the smaller of the two. n is the force and m the moment that the part
beyond s exerts on the part before it; f the load per length, d3 the tangent, q the quaternion of the section, kappa0 what it is bent and
twisted by when free. A slice is in equilibrium when

    r' = (1 + n.d3 / EA) d3,   n = n0 - f s,   m' = -r' x n,
    u = sum_i (d_i . m / K_i + kappa0_i) d_i,   q' = 1/2 (u, 0) (x) q,         K = (EI_1, EI_2, GJ)

with n0, the force at s = 0, as three parameters. That makes ten states. Ends: a clamp gives r and q, a hinge gives r and m = 0, a free end
n = 0 and m = 0. Collocation is of fourth order on a mesh that it refines by itself.

It starts from the shape under test, which chooses the branch among several equilibria and nothing else: what is returned meets the
equations to the tolerance stated. Nothing here is shared with the solver.

Source: S. S. Antman, "Nonlinear problems of elasticity", 2nd ed., Springer 2005, chapter VIII.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.integrate import solve_bvp
from scipy.spatial.transform import Rotation

from protocol.kinds import Hold
from protocol.messages import Problem, Shape
from protocol.scene import Vector

TOLERANCE: Final = 1e-8  # relative residual of the collocation
NODES_MAX: Final = 8000
POINTS: Final = 160  # of the mesh to start from, besides those of the shape under test
OFF: Final = 0.2  # of the length; a reference this far from the shape under test is another equilibrium


@dataclass(frozen=True)
class Reference:
    """The exact shape, as far as collocation tells it."""

    found: Any  # what solve_bvp returned, in scaled units
    length: float  # m
    force: float  # N, that of one in scaled units

    def nodes(self, s: np.ndarray) -> np.ndarray:
        """Points (n, 3) [m] of the axis at arc lengths s (n,) [m]."""
        points: np.ndarray = self.found.sol(s / self.length)[:3].T * self.length
        return points

    @property
    def first_force(self) -> np.ndarray:
        """Force (3,) [N] on the cable at its first end."""
        force: np.ndarray = -self.found.p * self.force
        return force

    @property
    def first_moment(self) -> np.ndarray:
        """Moment (3,) [N m] on the cable at its first end."""
        moment: np.ndarray = -self.found.y[7:, 0] * self.force * self.length
        return moment


def is_covered(problem: Problem) -> bool:
    """Whether a problem is one that this reference knows: held at both ends, at least one clamp, uniform, touching and carrying nothing."""
    held, cable = problem.grasps, problem.cable
    at_ends = len(held.s) == 2 and held.s[0] == 0.0 and held.s[-1] == cable.length
    plain = not cable.sections and not cable.masses and cable.micro_length is None and cable.bending is not None
    return (
        at_ends and plain and problem.contacts is None and problem.loads is None and Hold.GUIDE not in held.hold and Hold.CLAMP in held.hold
    )


def reference(
    problem: Problem, gravity: Vector, near: Shape, *, tolerance: float = TOLERANCE, points: np.ndarray | None = None
) -> Reference | None:
    """The equilibrium next to a shape; None where collocation does not get there, or somewhere else.

    Args:
        problem: One that `is_covered`.
        gravity: [m/s^2].
        near: A shape of the branch meant.
        tolerance: Relative residual of the collocation.
        points: (n,) Mesh to start from, from 0 to 1; fine, with the nodes of the shape, unless given.
    """
    scaled = Scaled.of(problem, gravity)
    fine = np.unique(np.concatenate([np.linspace(0.0, 1.0, POINTS), near.s / problem.cable.length]).round(9))
    mesh = fine if points is None else points
    states, force = scaled.states(near, mesh)
    with np.errstate(all="ignore"):
        found = solve_bvp(scaled.rate, scaled.miss, mesh, states, force, tol=tolerance, max_nodes=NODES_MAX, bc_tol=1e-3 * tolerance)
    if not found.success:
        return None
    exact = Reference(found, problem.cable.length, scaled.force)
    is_same = np.linalg.norm(exact.nodes(near.s) - near.nodes, axis=1).max() < OFF * problem.cable.length
    return exact if is_same else None


@dataclass(frozen=True)
class Scaled:
    """A problem in units of its length and of EI / L^2, as functions that `solve_bvp` calls."""

    law: np.ndarray  # (3,) EI_1, EI_2, GJ
    bent: np.ndarray  # (3,) curvatures and twist when free
    give: float  # 1 / EA
    load: np.ndarray  # (3,) per length
    places: np.ndarray  # (2, 3)
    frames: np.ndarray  # (2, 4)
    hold: tuple[Hold, ...]
    length: float  # m
    force: float  # N

    @classmethod
    def of(cls, problem: Problem, gravity: Vector) -> Scaled:
        """Scaled, from a problem that `is_covered`."""
        cable, held = problem.cable, problem.grasps
        assert cable.bending is not None
        assert cable.twist is not None
        law = np.array([cable.bending, cable.bending_2 or cable.bending, cable.twist])
        force = float(law[:2].min()) / cable.length**2
        return cls(
            law=law / law[:2].min(),
            bent=np.array(cable.natural_curvature or (0.0, 0.0, 0.0)) * cable.length,
            give=0.0 if cable.stretch is None else force / cable.stretch,
            load=cable.mass_per_length * np.asarray(gravity) * cable.length / force,
            places=held.position / cable.length,
            frames=held.quaternion,
            hold=held.hold,
            length=cable.length,
            force=force,
        )

    def rate(self, s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        """(10, n) Derivatives of the states r, q, m by s."""
        x, z, w, e = y[3:7]
        d1, d2, d3 = _directors(y[3:7])
        m = y[7:]
        n = p[:, None] - np.outer(self.load, s)
        slope = (1.0 + self.give * (n * d3).sum(0)) * d3
        turn = sum(((d * m).sum(0) / law + bent) * d for d, law, bent in zip((d1, d2, d3), self.law, self.bent, strict=True))
        a, b, c = turn
        half = 0.5 * np.array([e * a + b * w - c * z, e * b + c * x - a * w, e * c + a * z - b * x, -(a * x + b * z + c * w)])
        return np.concatenate([slope, half, np.cross(n, slope, axis=0)])

    def miss(self, a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        """(13,) What the ends miss their clamps by; the quaternion's length is kept by the equations and set once."""
        first, last = self.hold
        out = [a[:3] - self.places[0], b[:3] - self.places[1]]
        if first is Hold.CLAMP:
            out.append(a[3:7] - self.frames[0])
            out.append(_turned(self.frames[1], b[3:7]) if last is Hold.CLAMP else b[7:])
        else:
            out.append(a[7:])
            out.append(b[3:7] - self.frames[1] * math.copysign(1.0, float(b[3:7] @ self.frames[1])))
        return np.concatenate(out)

    def states(self, near: Shape, mesh: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States (10, n) and parameters (3,) of a shape, on a mesh; quaternions without a jump of sign."""
        frames = _continuous(near.frames)
        middle = 0.5 * (near.s[1:] + near.s[:-1]) / self.length
        quaternion = np.array([np.interp(mesh, middle, column) for column in frames.T])
        quaternion /= np.linalg.norm(quaternion, axis=0)
        # The first clamp sets the sign of its quaternion.
        if self.hold[0] is Hold.CLAMP and quaternion[:, 0] @ self.frames[0] < 0.0:
            quaternion = -quaternion
        turn = (Rotation.from_quat(frames[1:]) * Rotation.from_quat(frames[:-1]).inv()).as_rotvec() / np.diff(middle)[:, None]
        rates = np.array([np.interp(mesh, near.s[1:-1] / self.length, column) for column in turn.T])
        axes = _directors(quaternion)
        moment = sum(law * ((d * rates).sum(0) - bent) * d for d, law, bent in zip(axes, self.law, self.bent, strict=True))
        nodes = np.array([np.interp(mesh, near.s / self.length, column) for column in near.nodes.T]) / self.length
        force = -near.grasp_wrenches[0, :3] / self.force
        return np.concatenate([nodes, quaternion, moment]), force


def _directors(q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, y, z, e = q
    return (
        np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * e), 2 * (x * z - y * e)]),
        np.array([2 * (x * y - z * e), 1 - 2 * (x * x + z * z), 2 * (y * z + x * e)]),
        np.array([2 * (x * z + y * e), 2 * (y * z - x * e), 1 - 2 * (x * x + y * y)]),
    )


def _turned(frame: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Vector part (3,) of conj(frame) (x) q: zero where both are one frame."""
    v, e = frame[:3], frame[3]
    part: np.ndarray = e * q[:3] - q[3] * v - np.cross(v, q[:3])
    return part


def _continuous(frames: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) with the sign that makes each the neighbour of the one before."""
    flips = np.einsum("ij,ij->i", frames[1:], frames[:-1]) < 0.0
    sign = np.concatenate([[1.0], np.cumprod(np.where(flips, -1.0, 1.0))])
    out: np.ndarray = frames * sign[:, None]
    return out
