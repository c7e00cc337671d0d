"""What the half cells at clamps lack, for shapes that are combined from two meshes; compiled.

Between two nodes no couple acts on a staggered rod, so that its moment m stays and the section turns under it: the curvature precesses,
K kappa' = -kappa x m. A cell of length h with one curvature leaves that out. Along the shortest path from one frame to another
(Magnus' series, then the least of int kappa.K kappa / 2) the energy is less than that of the mean curvature by

    h^3 b.K^-1 b / 24,      b = kappa x m  [N],

so an inner cell is too stiff by this, and half a cell a = h / 2 by an eighth. The errors of all cells add up to even orders of h, if
that of half a cell is half of that of a whole one: it lacks (1/48 - 1/192) h^3 b.K^-1 b, or

    W = a^3 b.K^-1 b / 8  [J],      dW / d kappa = a (a^2 / 4) (m x c + K (c x kappa)),      c = K^-1 b.

Without it two meshes combined are of third order in space, wherever a clamp twists and bends at once; in a plane b is zero. The term is
added as a perturbation, by one linear solution, when meshes are combined: not to the energy, in which a mesh far too coarse for its twist
would make it large. With it the order is four (`tests/validation/test_mesh_richardson_1911.py`).

Source: derived here; Magnus 1954, "On the exponential solution of differential equations for a linear operator", Comm. Pure Appl. Math. 7.
"""

from __future__ import annotations

import numpy as np

from .band import eliminate
from .border import border_rows
from .jitted import kernel
from .newton import border_columns, linear_system
from .section_forces import clamp_moment
from .symmetric import solve_symmetric
from .vertices import CLAMP, relative, strain_scale, vertex

EXACT = (0.0, 0.0)  # no softness of rows


@kernel
def mend(rod, state, view):  # type: ignore[no-untyped-def]
    """What the missing term changes of an equilibrium, to first order.

    Returns:
        Turns (n-1, 3) [rad], changes of the forces of held points (h,) [N], moments (c, 3) [N m] of the term itself at all clamps, and
        its energy [J].
    """
    slope, moments, energy = lacking(rod, state)
    carried, _, diagonal, upper, beyond = linear_system(rod, state, view)
    border = border_rows(rod, state, view, EXACT, np.inf)
    matrix = border_columns(rod, view, border, carried, diagonal)
    count, many = len(border.element), len(rod.lengths)
    right = np.empty((many, 3, count + 1))
    right[:, :, :count], right[:, :, count] = matrix, slope
    eliminate(diagonal, upper, beyond, right)
    schur, wanted = border.compliance.copy(), np.zeros((count, 1))
    for j in range(many):
        for k in range(3):
            for r in range(count):
                wanted[r, 0] += matrix[j, k, r] * right[j, k, count]
                for c in range(count):
                    schur[r, c] += matrix[j, k, r] * right[j, k, c]
    change, _ = solve_symmetric(schur, wanted)
    turn, force = -right[:, :, count].copy(), np.zeros(len(state.force))
    for r in range(count):
        turn += change[r, 0] * right[:, :, r]
    for k in range(len(border.held)):
        force[border.held[k]] = change[k, 0]
    return turn, force, moments, energy


@kernel
def lacking(rod, state):  # type: ignore[no-untyped-def]
    """The missing term: its gradient (n-1, 3) [N m] with the turns of the segments, moments (c, 3) [N m] at clamps, energy [J]."""
    count, energy = len(rod.lengths), 0.0
    slope, moments, world = np.zeros((count, 3)), np.zeros((len(rod.clamp_frames), 3)), np.empty(3)
    rho, ga, gb, bent, ones = np.empty(4), np.empty(3), np.empty(3), np.empty(3), np.ones(3)
    haa, hab, hbb, work = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((4, 3, 3))
    for node in range(count + 1):
        clamp = rod.clamp_of_node[node]
        for side in range(2):
            segment = node - 1 + side
            if clamp < 0 or segment < 0 or segment >= count:
                continue
            first = state.frames[segment] if side == 0 else rod.clamp_frames[clamp]
            second = rod.clamp_frames[clamp] if side == 0 else state.frames[segment]
            cell = 0.5 * rod.lengths[segment]
            relative(first, second, rho)
            energy += _precession(rho, cell, rod.elastic.law[segment], rod.elastic.bent[segment], bent)
            # A law of one, and the curvature without load that leaves this moment: both functions are linear in the moment.
            vertex(first, second, cell, CLAMP, ones, bent, rho, ga, gb, haa, hab, hbb, work)
            clamp_moment(rho, cell, ones, bent, second, world)
            for k in range(3):
                slope[segment, k] += ga[k] if side == 0 else gb[k]
                moments[clamp, k] += world[k] if side == 0 else -world[k]
    return slope, moments, energy


@kernel
def _precession(rho, cell, law, natural, bent):  # type: ignore[no-untyped-def]
    """Energy [J] of the term at one side of a clamp; `bent` (3,) [1/m] becomes the curvature less dW / d kappa over the cell."""
    scale, share = strain_scale(rho[3], cell, CLAMP), 0.25 * cell * cell
    x, y, z = scale * rho[0], scale * rho[1], scale * rho[2]
    u, v, w = law[0] * (x - natural[0]), law[1] * (y - natural[1]), law[2] * (z - natural[2])
    p, q, r = y * w - z * v, z * u - x * w, x * v - y * u
    a, b, c = p / law[0], q / law[1], r / law[2]
    bent[0] = x - share * (v * c - w * b + law[0] * (b * z - c * y))
    bent[1] = y - share * (w * a - u * c + law[1] * (c * x - a * z))
    bent[2] = z - share * (u * b - v * a + law[2] * (a * y - b * x))
    return 0.5 * cell * share * (p * a + q * b + r * c)
