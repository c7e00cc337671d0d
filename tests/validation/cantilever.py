"""Reference for a rod in space clamped at one end: shooting with `scipy.integrate.solve_ivp`, section by section.

With a free far end the internal force is known everywhere. Three numbers are left, the moment at the clamp, found by Newton's
method so that the moment at the far end vanishes. The states are position, the three directors as a matrix, and the moment:

    r' = d3,   d_i' = u x d_i,   m' = -d3 x n,   u = sum_i (k_i + m.d_i / B_i) d_i,   B = (EI_1, EI_2, GJ)

with k the curvature and twist that are free of any load (Antman 2005, "Nonlinear problems of elasticity", 2nd ed., ch. VIII).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class Part:
    """A uniform part of the rod, in the order from the clamp."""

    length: float  # m
    stiffness: tuple[float, float, float]  # N m^2, EI about d1, EI about d2, GJ
    weight: float = 0.0  # N/m, along -z
    natural: tuple[float, float, float] = (0.0, 0.0, 0.0)  # 1/m
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)  # N, at its far end


def marched(parts: tuple[Part, ...], frame: np.ndarray, moment: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Places (parts, 3) [m] at the far end of every part, and the moment [N m] left at the last one, at a `share` of all loads."""
    state = np.concatenate([np.zeros(3), Rotation.from_quat(frame).as_matrix().ravel(), moment])
    places = []
    for index, part in enumerate(parts):
        beyond = sum(np.array(other.force) + other.length * other.weight * np.array([0.0, 0.0, -1.0]) for other in parts[index + 1 :])
        last = share * (beyond + np.array(part.force))

        def rhs(s: float, y: np.ndarray, part: Part = part, last: np.ndarray = last) -> np.ndarray:
            turn = y[3:12].reshape(3, 3)
            force = last + share * part.weight * (part.length - s) * np.array([0.0, 0.0, -1.0])
            spin = turn @ (np.array(part.natural) + turn.T @ y[12:] / np.array(part.stiffness))
            return np.concatenate([turn[:, 2], np.cross(spin, turn, axisb=0, axisc=0).ravel(), -np.cross(turn[:, 2], force)])

        state = solve_ivp(rhs, (0.0, part.length), state, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        places.append(state[:3])
    return np.array(places), state[12:]


def cantilever(parts: tuple[Part, ...], frame: np.ndarray, *, steps: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Places (parts, 3) [m] at the far end of every part, and the moment (3,) [N m] inside the rod at the clamp.

    Args:
        parts: From the clamp, which is at the origin.
        frame: (4,) Quaternion of the clamp.
        steps: In which the loads are put on.
    """
    moment = np.zeros(3)
    for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
        found = root(lambda m, share=share: marched(parts, frame, m, share)[1], moment, tol=1e-13)
        moment = found.x
        assert np.abs(marched(parts, frame, moment, share)[1]).max() < 1e-9 * max(1.0, np.abs(moment).max()), found.message
    return marched(parts, frame, moment, 1.0)[0], moment
