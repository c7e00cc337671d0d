"""A branch condensed to its end: the stiffness and the force of a chain of segments as seen from the pose of its last clamp.

With everything else held, the energy of a settled chain is a function E(x, phi) of the place x and the turn phi of its last clamp.
Its gradient is the wrench of the clamp on the cable, its Hessian the stiffness. Both come from the elimination of a Newton step
(see `newton`) with three right-hand sides more. With H the Hessian over the turns theta of the segments, C the border columns and B
their compliance, D and F the blocks of the last vertex between segment and clamp, and of the clamp itself,

    H theta + D phi = C f,   C^T theta + B f = P x,   S = C^T H^-1 C + B,   G = C^T H^-1 D,

P picking the rows of the clamp's position; f = S^-1 (P x + G phi) and with it

    K = [ P^T S^-1 P   P^T S^-1 G                     ]
        [ G^T S^-1 P   F - D^T H^-1 D + G^T S^-1 G    ]

From chains to trees: a port is to the clamp it ends at what a segment is to the next one, a 6x6 block and a force that are added there.
Branches that end in one rigid body, on which a load acts, are in balance when sum(force) = load, and Newton's method on the pose of that
body is sum(stiffness) change = load - sum(force). If the body sits at the end of a further chain instead, that sum is a spring on the last
clamp of this chain, and its own port, with the sum added, stands for the whole tree beyond: leaves first, the cost linear in segments.

Turns are rotation vectors in the world frame, R <- exp(phi) R. The moment m is that of the world too; since it turns with the clamp,
its derivative is that of the Hessian less half of m x: dm = (K phi) - m x phi / 2. Where branches are in balance these halves cancel.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.errors import CablecosimError

from .rod import State
from .system import System

Array = np.ndarray
EXACT = (0.0, 0.0)  # no softness of rows


@dataclass(frozen=True)
class Port:
    """A chain as seen from its last clamp: position, then rotation vector in the world frame."""

    stiffness: Array  # (6, 6) N/m, N and N m, symmetric: Hessian of the energy
    force: Array  # (6,) N and N m, of the clamp on the cable: gradient of the energy


def port(system: System, state: State, path: ModuleType) -> Port:
    """The port of a settled chain; its contacts stay as they are, open or pushing.

    Args:
        system: The equations of the chain; a clamp holds its last node, and something else its position.
        state: At an equilibrium.
        path: `numpy_path`, or the compiled `kernels`.

    Raises:
        CablecosimError: If the last node is not clamped, nothing else holds the cable, or it has a micro-structure length or friction.
    """
    rod = system.rod
    if len(rod.elastic.smoothing) or len(rod.elastic.limit) or len(rod.strands.distance):
        raise CablecosimError("a port is not built for 'micro_length', 'bend_radius' and self-contacts; leave them out")
    if len(rod.rub.rows):
        raise CablecosimError("a port is not built for contacts with friction; give them 'none' or 'bond'")
    clamp, last = int(rod.clamp_of_node[-1]), len(system.mesh.grasp_nodes) - 1
    if clamp < 0 or np.count_nonzero(system.row_grasp == last) != 3:
        raise CablecosimError("a port is the clamp at the end of a cable that is held elsewhere too; add a grasp, or turn the cable round")
    state, view = path.look(rod, state, np.ascontiguousarray(rod.touch["normal"]))
    carried, _, diagonal, upper, _ = path.linear_system(rod, state, view)
    border = path.border_rows(rod, state, view, EXACT, np.inf)
    matrix = path.border_columns(rod, view, border, carried, diagonal)
    kept = np.ones(len(border.element), dtype=bool)
    kept[len(border.held) : len(border.held) + len(border.contacts)] = state.touches[border.contacts]
    held, (moment, own, coupling) = matrix[:, :, kept], _last_vertex(system, state, clamp, path)
    right = np.zeros((len(rod.lengths), 3, held.shape[2] + 3))
    right[:, :, :-3] = held
    right[-1, :, -3:] = coupling
    path.factor_and_solve(diagonal, upper, right)
    schur = np.einsum("jkc,jkd->cd", held, right)  # S and G
    rows = np.flatnonzero(system.row_grasp[border.held] == last)
    picked = np.zeros((held.shape[2], 6))
    picked[rows, :3] = rod.held.rows["axis"][border.held[rows]]
    picked[:, 3:] = schur[:, -3:]
    # A row that two others say already has no compliance of its own: the symmetric solver holds it softly.
    answers, _ = path.solve_symmetric(schur[:, :-3] + border.compliance[np.ix_(kept, kept)], picked)
    stiffness = picked.T @ answers
    stiffness[3:, 3:] += own - coupling.T @ right[-1, :, -3:]
    force = np.concatenate([rod.held.rows["axis"][border.held[rows]].T @ state.force[border.held[rows]], moment])
    return _turned(stiffness, force, rod.clamp_frames[clamp])


def _last_vertex(system: System, state: State, clamp: int, path: ModuleType) -> tuple[Array, Array, Array]:
    """Gradient (3,) and Hessian (3, 3) with the turn of the last clamp, and the block (3, 3) between the last segment and it.

    Found with the parts of clamp and segment exchanged; turns are in the axes of the frames. A turn theta of the segment is one of the
    clamp by -Q^T theta, Q from one to the other, which is made before its own and hence brings a half of the product of both turns.
    """
    rod, elastic = system.rod, system.rod.elastic
    both = np.concatenate([elastic.law[-1:]] * 2), np.concatenate([elastic.bent[-1:]] * 2)
    single = elastic._replace(law=both[0][:1], bent=both[1][:1], node_law=both[0], node_bent=both[1])
    held, own = np.array([0, -1]), rod.clamp_frames[clamp : clamp + 1]
    length, none = rod.lengths[-1:], np.zeros((1, 3))
    gradient, diagonal, _ = path.assemble(own, np.zeros((1, 3, 3)), length, length, single, held, state.frames[-1:], none)
    to_segment = (Rotation.from_quat(state.frames[-1]).inv() * Rotation.from_quat(own[0])).as_matrix()
    return gradient[0], diagonal[0], to_segment @ (0.5 * np.cross(np.eye(3), gradient[0]) - diagonal[0])


def _turned(stiffness: Array, force: Array, quaternion: Array) -> Port:
    """From turns in the axes of the clamp to turns in the world frame."""
    to_world = np.eye(6)
    to_world[3:, 3:] = Rotation.from_quat(quaternion).as_matrix()
    out = Port(to_world @ stiffness @ to_world.T, to_world @ force)
    out.stiffness.setflags(write=False)
    out.force.setflags(write=False)
    return out
