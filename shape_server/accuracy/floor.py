"""Independent reference of a heavy rod that lies on a floor between two clamps, in a plane, without friction.

In units of the length L and of EI / L^2, w = weight L^3 / EI, for a piece between clamp and touch-down, with slope a and curvature k:

    x' = cos a,   z' = sin a,   a' = k,   k' = h sin a - (v + w s) cos a

The clamp gives x, z and a; the touch-down point gives z, a = 0 and k = 0, for what lies is straight and level. Both pieces feel the same
horizontal force h, and what they leave of the length lies between their touch-down points: thirteen conditions for two pieces of four
states each and five parameters, h, and v and the length of either piece. Collocated by `scipy.integrate.solve_bvp`.

Source: S. P. Timoshenko, J. M. Gere, "Theory of elastic stability", 2nd ed., McGraw-Hill 1961, section 2.7, for the equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.integrate import solve_bvp

from protocol.messages import Shape

TOLERANCE: Final = 1e-9
POINTS: Final = 200
NODES_MAX: Final = 4000
LYING: Final = 1e-6  # of the length; what is higher does not lie


@dataclass(frozen=True)
class Lying:
    """A cable of which a part lies."""

    found: Any  # of solve_bvp: x, z, a, k of the first piece and of the last, each on 0 to 1 in the direction of the cable
    length: float  # m
    height: float  # m, of the axis where it lies

    def nodes(self, s: np.ndarray) -> np.ndarray:
        """Points (n, 3) [m] of the axis in the plane x-z at arc lengths s (n,) [m]."""
        first, last = self.found.p[2] * self.length, self.found.p[3] * self.length
        down, up = s < first, s > self.length - last
        out = np.column_stack([self.found.y[0, -1] * self.length + s - first, np.zeros_like(s), np.full_like(s, self.height)])
        for chosen, share, row in ((down, s / first, 0), (up, (s - self.length + last) / last, 4)):
            out[chosen] = (self.found.sol(share[chosen])[[row, row, row + 1]] * self.length).T * np.array([1.0, 0.0, 1.0])
        return out


@dataclass(frozen=True)
class Laid:
    """Two clamps over a floor, scaled, as functions for `solve_bvp`; parameters: h, v of the first piece, both lengths, v of the last."""

    load: float  # w
    ends: np.ndarray  # (2, 3) x, z and slope
    height: float

    def rate(self, s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        """(8, n) Derivatives of x, z, a, k of both pieces."""
        h, v_first, first, last, v_last = p
        return np.concatenate([self._piece(s, y[:4], h, v_first, first), self._piece(s, y[4:], h, v_last, last)])

    def miss(self, a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        """(13,) What clamps, touch-down points and the part between them miss."""
        flat = np.array([self.height, 0.0, 0.0])
        return np.concatenate(
            [a[:3] - self.ends[0], b[1:4] - flat, a[5:8] - flat, b[4:7] - self.ends[1], [a[4] - b[0] - (1 - p[2] - p[3])]]
        )

    def _piece(self, s: np.ndarray, y: np.ndarray, h: float, v: float, own: float) -> np.ndarray:
        cos, sin = np.cos(y[2]), np.sin(y[2])
        return own * np.array([cos, sin, y[3], h * sin - (v + self.load * own * s) * cos])


def lying(bending: float, weight: float, length: float, ends: np.ndarray, height: float, near: Shape) -> Lying | None:
    """The exact shape next to one under test; None where collocation does not get there.

    Args:
        bending: [N m^2] EI.
        weight: [N/m].
        length: [m].
        ends: (2, 3) [m, m, rad] x, z and slope of both clamps.
        height: [m] Of the axis where it lies.
        near: A shape in the plane x-z, of which a part lies.
    """
    low = near.s[near.nodes[:, 2] < height + LYING * length]
    if len(low) < 2:
        return None
    laid = Laid(weight * length**3 / bending, ends / np.array([length, length, 1.0]), height / length)
    scale = bending / length**2
    first, last = low[0] / length, 1.0 - low[-1] / length
    v_first, h = -near.grasp_wrenches[0, 2] / scale, -near.grasp_wrenches[0, 0] / scale
    v_last = near.grasp_wrenches[1, 2] / scale - laid.load * last
    mesh = np.linspace(0.0, 1.0, POINTS)
    states = np.vstack([_states(near, first * mesh), _states(near, 1.0 - last * (1.0 - mesh))])
    with np.errstate(all="ignore"):
        found = solve_bvp(
            laid.rate, laid.miss, mesh, states, np.array([h, v_first, first, last, v_last]), tol=TOLERANCE, max_nodes=NODES_MAX
        )
    return Lying(found, length, height) if found.success else None


def _states(near: Shape, share: np.ndarray) -> np.ndarray:
    """x, z, slope and curvature (4, n) of a shape in the plane x-z, scaled by its length."""
    length, step = near.s[-1], np.diff(near.nodes, axis=0)
    slope, middle = np.unwrap(np.arctan2(step[:, 2], step[:, 0])), 0.5 * (near.s[1:] + near.s[:-1]) / length
    bend = np.interp(share, near.s[1:-1] / length, np.diff(slope) / np.diff(middle))
    x, z = (np.interp(share, near.s / length, near.nodes[:, axis]) / length for axis in (0, 2))
    return np.array([x, z, np.interp(share, middle, slope), bend])
