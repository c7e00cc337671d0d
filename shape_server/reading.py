"""What a solved rod says: tension, curvature, forces and moments at its grasps and contacts."""

from __future__ import annotations

import numpy as np

from .mesh import Mesh
from .numpy_path import relative, vertices
from .rod import Rod, State, View, node_forces


def tension(rod: Rod, state: State, view: View) -> np.ndarray:
    """(n-1,) [N] Force along every segment at its middle."""
    carried = rod.path.carried_forces(node_forces(rod, state, view), rod.base)
    along: np.ndarray = np.einsum("ij,ij->i", carried, view.axes[:, 2])
    return along


def curvature_and_moments(rod: Rod, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Bending curvature (n,) [1/m] at every node, and moment (c, 3) [N m] on the cable at every clamp.

    At a clamp inside the cable the larger curvature of its two sides is given.
    """
    mesh: Mesh = rod.mesh
    before, after, cells, first, second = vertices(state.frames, mesh.lengths, rod.clamp_of_node, rod.clamp_frames)
    rho = relative(before, after)
    sigma = rho[:, :3] / (1 + rho[:, 3:])
    strain = 4 * sigma / cells[:, None]
    node = np.where(first >= 0, first + 1, second)
    curvature = np.zeros(len(mesh.s))
    np.maximum.at(curvature, node, np.hypot(strain[:, 0], strain[:, 1]))
    moments = np.zeros((len(rod.clamp_frames), 3))
    for vertex in np.flatnonzero((first < 0) | (second < 0)):
        clamp = rod.clamp_of_node[node[vertex]]
        turned = _moment(sigma[vertex], rod.law * strain[vertex], after[vertex])
        moments[clamp] += turned if second[vertex] < 0 else -turned
    return curvature, moments


def _moment(sigma: np.ndarray, moment: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Moment (3,) [N m], world frame, that the part after a vertex exerts on the part before it.

    The gradient of the vertex energy with respect to a turn of the later frame, in that frame's axes, turned to the world.
    """
    s0, s1, s2 = sigma.tolist()
    m0, m1, m2 = moment.tolist()
    x, y, z, w = frame.tolist()
    plain, along = 1.0 - s0 * s0 - s1 * s1 - s2 * s2, 2.0 * (s0 * m0 + s1 * m1 + s2 * m2)
    # 4 B^T moment with B as in `kernels`, then turned by the frame.
    u = plain * m0 - 2.0 * (s1 * m2 - s2 * m1) + along * s0
    v = plain * m1 - 2.0 * (s2 * m0 - s0 * m2) + along * s1
    t = plain * m2 - 2.0 * (s0 * m1 - s1 * m0) + along * s2
    a, b, c = y * t - z * v + w * u, z * u - x * t + w * v, x * v - y * u + w * t
    return np.array([u + 2.0 * (y * c - z * b), v + 2.0 * (z * a - x * c), t + 2.0 * (x * b - y * a)])
