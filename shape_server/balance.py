"""Forces and moments of the whole cable, brought into balance to rounding.

The wrenches at the grasps come from an iteration that stops at about 1e-8 of the weight, or are combined from two meshes, whose
products do not add up exactly. The smallest change of all of them (least squares, moments over the length of the cable) that
balances weight, loads and contacts is added; it is far below their estimated errors.

On one mesh half the weight of every segment acts at each of its nodes. Of two meshes combined the positions are of fourth order, and so
must be the weight's moment, or the balance would make wrenches of second order from those of fourth: the same combination of the
loads of both meshes, 4/3 of the finer one's less 1/3 of the coarser one's, is Simpson's rule over every pair of segments. (Half
of each segment's weight at its nodes puts the centre of weight off by h^2 / 12 times the difference of the end tangents, over the length.)

A cable that only hinges hold, all in one line or one point, swings about them, and no force there can hold it back. Nodes combined from
two meshes are turned about that line until their loads balance, by less than their estimated error.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from protocol.kinds import Hold
from protocol.messages import Problem

IN_LINE: Final = 1e-4  # of the length, how far hinges may lie from the line that the cable swings about
TURNS: Final = 3  # each leaves the square of the angle before


def balanced(
    problem: Problem,
    held: np.ndarray,
    nodes: np.ndarray,
    loads: np.ndarray,
    wrenches: np.ndarray,
    contact_forces: np.ndarray,
    contact_moment: np.ndarray,
) -> np.ndarray:
    """The wrenches (g, 6) [N and N m] after the smallest change that balances them.

    Args:
        problem: How the cable is held.
        held: (g, 3) [m] Held points, where a guide has let them slide to.
        nodes: (n, 3) [m].
        loads: (n, 3) [N] on the nodes.
        wrenches: (g, 6) forces and moments at the grasps.
        contact_forces: (m, 3) [N].
        contact_moment: (3,) [N m] of all contacts about the world's origin.
    """
    length = problem.cable.length
    out = wrenches.copy()
    out[:, :3] -= (loads.sum(axis=0) + out[:, :3].sum(axis=0) + contact_forces.sum(axis=0)) / len(out)
    arms = held - held.mean(axis=0)
    others = cross_sum(nodes, loads) + contact_moment
    framed = [k for k, hold in enumerate(problem.grasps.hold) if hold is not Hold.HINGE]
    lacking = -(_moment(out, held) + others) / length
    # Forces change by amounts that add up to nothing: their arms count from the middle of all grasps.
    change = _least(arms / length, len(framed), lacking)
    out[:, :3] += change[: len(out)] - change[: len(out)].sum(axis=0) / len(out)
    if framed:
        out[framed, 3:] += length * change[len(out) :]
        out[framed, 3:] -= (_moment(out, held) + others) / len(framed)
    return out


def swung(problem: Problem, held: np.ndarray, nodes: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """The nodes (n, 3) [m] turned about the hinges until the loads (n, 3) [N] do not turn them further; as they are, if none can swing."""
    middle, length = held.mean(axis=0), problem.cable.length
    _, sizes, directions = np.linalg.svd(held - middle)
    wide = int((sizes > IN_LINE * length).sum())
    if wide > 1 or any(hold is not Hold.HINGE for hold in problem.grasps.hold):
        return nodes
    from scipy.spatial.transform import Rotation  # here: 0.2 s that others do without

    free = directions[:1] if wide == 1 else np.eye(3)  # (k, 3) axes to turn about
    for _ in range(TURNS):
        arms = nodes - middle
        couple = free @ cross_sum(arms, loads)
        # (turn x arm) x force = arm (turn . force) - turn (arm . force)
        slope = free @ (arms.T @ loads - np.eye(3) * np.vdot(arms, loads)) @ free.T
        turn = np.linalg.lstsq(slope, -couple, rcond=1e-9)[0]
        nodes = middle + Rotation.from_rotvec(turn @ free).apply(arms)
    return nodes


def _least(arms: np.ndarray, framed: int, lacking: np.ndarray) -> np.ndarray:
    """The smallest forces (g, 3) at arms (g, 3), and moments (framed, 3) after them, whose sum of moments is `lacking` (3,)."""
    if not framed:
        columns = np.hstack([_cross(arm) for arm in arms])
        least: np.ndarray = np.linalg.lstsq(columns, lacking, rcond=1e-9)[0].reshape(-1, 3)
        return least
    # The normal equations of forces a x f and moments: (sum (a.a I - a a^T) + framed I) y = lacking, f = y x a.
    own = framed + np.vdot(arms, arms)
    y = np.linalg.solve(np.diag([own, own, own]) - arms.T @ arms, lacking)
    return np.vstack([arms @ _cross(y).T, np.tile(y, (framed, 1))])


def _moment(wrenches: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Moment (3,) [N m] of the grasps about the world's origin."""
    out: np.ndarray = wrenches[:, 3:].sum(axis=0) + cross_sum(held, wrenches[:, :3])
    return out


def cross_sum(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Sum (3,) of the vector products of rows (n, 3)."""
    m = first.T @ second
    return np.array([m[1, 2] - m[2, 1], m[2, 0] - m[0, 2], m[0, 1] - m[1, 0]])


def _cross(arm: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) of the vector product with an arm."""
    x, y, z = arm.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
