"""How a settled rod answers small motions of its grasps: one more solve with the same elimination, compiled.

At an equilibrium g(theta, y, p) = 0 and r(theta, y, p) = 0, with p the poses of the grasps. The turn and the change of the forces
with a pose solve the system of a Newton step with other right-hand sides,

    [ H   -C ] [ theta ]     [ -dg/dp ]         dg/dp: the frame of a clamp turns the end of its half cell
    [ C^T  B ] [ y     ]  =  [ -dr/dp ]         dr/dp: the goal of a row moves, or all positions do with the base

and the moment at a clamp, R dE/dphi, changes by R (E_phi_phi phi + E_phi_theta theta + phi x E_phi / 2) with the turn phi of the
clamp in its own axes; half of phi x E_phi, as second derivatives here are along exp(theta). Derived here, checked by
differences in the tests.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .border import border_rows
from .elimination import factor_and_solve
from .newton import border_columns, fix_gauge, linear_system
from .symmetric import solve_symmetric
from .vertices import CLAMP, vertex


@njit(cache=True)
def response(rod, held, state, view):  # type: ignore[no-untyped-def]
    """Changes of the nodes (n, 3, 6 g) and of the wrenches at all grasps (6 g, 6 g) with the grasps' poses.

    Poses and wrenches in the order of the grasps, positions and forces first, then turns about the world's axes and moments; `held` says
    which grasp each row, each clamp and the base belongs to. Without contacts, bonds, guides and stretch.
    """
    grasp_of_row, grasp_of_clamp, base = held
    count, rows = len(rod.lengths), len(rod.held.element)
    many = 6 * (max(grasp_of_row.max() if rows > 0 else 0, max(base, grasp_of_clamp.max() if len(grasp_of_clamp) > 0 else 0)) + 1)
    carried, _, diagonal, upper, _ = linear_system(rod, state, view)
    fix_gauge(rod, diagonal, 0.0)
    border = border_rows(rod, state, view, (0.0, 0.0))
    matrix = border_columns(rod, view, border, carried, diagonal).reshape(3 * count, rows)
    right, goals = np.zeros((3 * count, rows + many)), np.zeros((rows, many))
    right[:, :rows] = matrix
    for row in range(rows):
        for k in range(3):
            goals[row, 6 * grasp_of_row[row] + k] = rod.held.axis[row, k]
            goals[row, 6 * base + k] = -rod.held.axis[row, k]
    _add_turned_clamps(rod, grasp_of_clamp, state, right[:, rows:])
    factor_and_solve(diagonal, upper, right.reshape(count, 3, rows + many))
    force = np.zeros((rows, many))
    turn = -right[:, rows:]
    if rows > 0:
        schur = np.ascontiguousarray(matrix.T) @ right
        force, _ = solve_symmetric(np.ascontiguousarray(schur[:, :rows]) + border.compliance, goals + schur[:, rows:])
        turn = turn + np.ascontiguousarray(right[:, :rows]) @ force
    wrenches = np.zeros((many, many))
    for row in range(rows):
        for k in range(3):
            wrenches[6 * grasp_of_row[row] + k] += rod.held.axis[row, k] * force[row]
            wrenches[6 * base + k] -= rod.held.axis[row, k] * force[row]
    _add_moments(rod, grasp_of_clamp, state, turn, wrenches)
    return _moved_nodes(rod, view, turn, base), wrenches


@njit(cache=True)
def _side(rod, state, node, side):  # type: ignore[no-untyped-def]
    """Segment beside a clamp, derivatives of the energy of the half cell: by the clamp, twice by it, by segment and clamp."""
    clamp, segment = rod.clamp_of_node[node], node - 1 + side
    rho, ga, gb = np.empty(4), np.empty(3), np.empty(3)
    haa, hab, hbb, work = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((4, 3, 3))
    first = state.frames[segment] if side == 0 else rod.clamp_frames[clamp]
    second = rod.clamp_frames[clamp] if side == 0 else state.frames[segment]
    law, bent = rod.elastic.law[segment], rod.elastic.bent[segment]
    vertex(first, second, 0.5 * rod.lengths[segment], CLAMP, law, bent, rho, ga, gb, haa, hab, hbb, work)
    if side == 0:
        return segment, gb, hbb, hab
    return segment, ga, haa, np.ascontiguousarray(hab.T)


@njit(cache=True)
def _matrix(frame):  # type: ignore[no-untyped-def]
    """Rotation matrix (3, 3) of a frame; its columns are the directors."""
    x, y, z, w = frame[0], frame[1], frame[2], frame[3]
    out = np.empty((3, 3))
    out[0, 0], out[0, 1], out[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    out[1, 0], out[1, 1], out[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    out[2, 0], out[2, 1], out[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return out


@njit(cache=True)
def _add_turned_clamps(rod, grasp_of_clamp, state, slopes):  # type: ignore[no-untyped-def]
    """Add the change of the gradient with turns of the clamps about the world's axes to `slopes` (3 (n-1), 6 g)."""
    for node in range(len(rod.clamp_of_node)):
        clamp = rod.clamp_of_node[node]
        for side in range(2):
            if clamp < 0 or not 0 <= node - 1 + side < len(rod.lengths):
                continue
            segment, _, _, mixed = _side(rod, state, node, side)
            turned = mixed @ _matrix(rod.clamp_frames[clamp]).T
            at = 6 * grasp_of_clamp[clamp] + 3
            for r in range(3):
                for c in range(3):
                    slopes[3 * segment + r, at + c] += turned[r, c]


@njit(cache=True)
def _add_moments(rod, grasp_of_clamp, state, turn, wrenches):  # type: ignore[no-untyped-def]
    """Add the change of the moments at the clamps to `wrenches` (6 g, 6 g)."""
    for node in range(len(rod.clamp_of_node)):
        clamp = rod.clamp_of_node[node]
        for side in range(2):
            if clamp < 0 or not 0 <= node - 1 + side < len(rod.lengths):
                continue
            segment, slope, own, mixed = _side(rod, state, node, side)
            frame = _matrix(rod.clamp_frames[clamp])
            at = 6 * grasp_of_clamp[clamp] + 3
            wrenches[at : at + 3] += frame @ np.ascontiguousarray(mixed.T) @ np.ascontiguousarray(turn[3 * segment : 3 * segment + 3])
            cross = np.zeros((3, 3))  # phi x slope / 2 as a matrix times phi
            cross[0, 1], cross[0, 2], cross[1, 2] = 0.5 * slope[2], -0.5 * slope[1], 0.5 * slope[0]
            cross[1, 0], cross[2, 0], cross[2, 1] = -cross[0, 1], -cross[0, 2], -cross[1, 2]
            wrenches[at : at + 3, at : at + 3] += frame @ (own + cross) @ frame.T


@njit(cache=True)
def _moved_nodes(rod, view, turn, base):  # type: ignore[no-untyped-def]
    """Change of every node (n, 3, 6 g) with the turns of the segments (3 (n-1), 6 g), and with the base itself."""
    count, many = len(rod.lengths), turn.shape[1]
    out = np.zeros((count + 1, 3, many))
    for k in range(3):
        out[rod.base, k, 6 * base + k] = 1.0
    for j in range(rod.base, count):
        for k in range(3):
            for c in range(many):
                edge = turn[3 * j + 1, c] * view.axes[j, 0, k] - turn[3 * j, c] * view.axes[j, 1, k]
                out[j + 1, k, c] = out[j, k, c] + view.lengths[j] * edge
    for j in range(rod.base - 1, -1, -1):
        for k in range(3):
            for c in range(many):
                edge = turn[3 * j + 1, c] * view.axes[j, 0, k] - turn[3 * j, c] * view.axes[j, 1, k]
                out[j, k, c] = out[j + 1, k, c] - view.lengths[j] * edge
    return out
