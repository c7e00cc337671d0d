"""Forces and moments of the whole cable, brought into balance to rounding.

The wrenches at the grasps come from an iteration that stops at about 1e-8 of the weight, or are combined from two meshes, whose
products do not add up exactly. The smallest change of all of them (least squares, moments over the length of the cable) that
balances weight, loads and contacts is added; it is far below their estimated errors. With contacts only the forces are
balanced: a force on an edge acts there and not on the axis.
"""

from __future__ import annotations

import numpy as np

from protocol.kinds import Hold
from protocol.messages import Problem


def balanced(
    problem: Problem, held: np.ndarray, nodes: np.ndarray, loads: np.ndarray, wrenches: np.ndarray, contact_forces: np.ndarray
) -> np.ndarray:
    """The wrenches (g, 6) [N and N m] after the smallest change that balances them.

    Args:
        problem: How the cable is held.
        held: (g, 3) [m] Held points, where a guide has let them slide to.
        nodes: (n, 3) [m].
        loads: (n, 3) [N] on the nodes.
        wrenches: (g, 6) forces and moments at the grasps.
        contact_forces: (m, 3) [N].
    """
    grasps, length = problem.grasps, problem.cable.length
    out = wrenches.copy()
    out[:, :3] -= (loads.sum(axis=0) + out[:, :3].sum(axis=0) + contact_forces.sum(axis=0)) / len(out)
    if len(contact_forces):
        return out
    arms = held - held.mean(axis=0)
    moment = out[:, 3:].sum(axis=0) + np.cross(held, out[:, :3]).sum(axis=0) + np.cross(nodes, loads).sum(axis=0)
    framed = np.array([hold is not Hold.HINGE for hold in grasps.hold])
    columns = [_cross(arm) / length for arm in arms] + [np.eye(3)] * int(framed.sum())
    # Forces change by amounts that add up to nothing: their arms count from the middle of all grasps.
    change = np.linalg.lstsq(np.hstack(columns), -moment / length, rcond=1e-9)[0].reshape(-1, 3)
    force = change[: len(out)] - change[: len(out)].mean(axis=0)
    out[:, :3] += force
    out[framed, 3:] += length * change[len(out) :]
    left = out[:, 3:].sum(axis=0) + np.cross(held, out[:, :3]).sum(axis=0) + np.cross(nodes, loads).sum(axis=0)
    if framed.any():
        out[framed, 3:] -= left / framed.sum()
    return out


def _cross(arm: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) of the vector product with an arm."""
    x, y, z = arm.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
