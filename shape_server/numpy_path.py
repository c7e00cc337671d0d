"""The same functions as in `kernels`, without a compiler: serves until the kernels are compiled, and checks them.

What costs most is written here for numpy and LAPACK, all segments at once; the rest is the very source of the compiled functions,
run by Python. Every function takes and returns exactly what its namesake does; the physics is explained there.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from . import kernels
from .interpreted import interpreted
from .rod import Elastic
from .symmetric import FLOOR
from .vertices import CLAMP, INNER, LEAST

Array = np.ndarray


def directors(frames: Array) -> Array:
    """Directors of every segment: (n-1, 3, 3), rows d1, d2, d3."""
    x, y, z, w = frames.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
        [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
        [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0))


def positions(tangents: Array, lengths: Array, base: int, origin: Array) -> Array:
    """Nodes (n, 3) from the tangents (n-1, 3), with node `base` at `origin`."""
    nodes = np.zeros((len(lengths) + 1, 3))
    nodes[1:] = np.cumsum(lengths[:, None] * tangents, axis=0)
    nodes += origin - nodes[base]
    return nodes


def carried_forces(forces: Array, base: int) -> Array:
    """Force that each segment hands towards the base: (n-1, 3) from the node forces (n, 3)."""
    total = np.cumsum(forces, axis=0)
    beyond: Array = total[-1] - total[:-1]
    beyond[:base] = -total[:base]
    return beyond


def elastic_energy(frames: Array, lengths: Array, elastic: Elastic, clamp_of_node: Array, clamp_frames: Array) -> float:
    """Energy of bending and twist [J]."""
    at = vertices(frames, lengths, elastic, clamp_of_node, clamp_frames)
    return float((0.5 * at.cells[:, None] * at.law * at.strain**2).sum())


def assemble(
    frames: Array, axes: Array, lengths: Array, pulled: Array, elastic: Elastic, clamp_of_node: Array, clamp_frames: Array, carried: Array
) -> tuple[Array, Array, Array]:
    """Gradient (n-1, 3), diagonal (n-1, 3, 3) and upper blocks (n-1, 3, 3) of energy less the work of the forces."""
    count = len(lengths)
    local = np.einsum("jkx,jx->jk", axes, carried) * pulled[:, None]
    gradient = np.stack([local[:, 1], -local[:, 0], np.zeros(count)], axis=1)
    diagonal = np.zeros((count, 3, 3))
    diagonal[:, 0, 0] = diagonal[:, 1, 1] = local[:, 2]
    diagonal[:, 0, 2] = diagonal[:, 2, 0] = -0.5 * local[:, 0]
    diagonal[:, 1, 2] = diagonal[:, 2, 1] = -0.5 * local[:, 1]
    upper = np.zeros((count, 3, 3))
    at = vertices(frames, lengths, elastic, clamp_of_node, clamp_frames)
    ga, gb, haa, hab, hbb = _vertex_terms(at)
    has_first, has_second = at.first >= 0, at.second >= 0
    np.add.at(gradient, at.first[has_first], ga[has_first])
    np.add.at(gradient, at.second[has_second], gb[has_second])
    np.add.at(diagonal, at.first[has_first], haa[has_first])
    np.add.at(diagonal, at.second[has_second], hbb[has_second])
    inner = has_first & has_second
    upper[at.first[inner]] = hab[inner]
    return gradient, diagonal, upper


def columns(axes: Array, lengths: Array, base: int, element: Array, fraction: Array, vector: Array, is_turn: Array) -> Array:
    """Border columns (n-1, 3, m): change of each scalar quantity with the rotation of every segment."""
    j = np.arange(len(lengths))[:, None]
    ahead = (j >= base) & (j <= element)
    behind = (j < base) & (j >= element)
    weight = np.where(ahead, 1.0, np.where(behind, -1.0, 0.0)) * lengths[:, None]
    own = j == element
    weight = np.where(own, weight * np.where(element >= base, fraction, 1 - fraction), weight)
    weight = np.where(is_turn.astype(bool), own.astype(float), weight)
    out = np.zeros((len(lengths), 3, len(element)))
    out[:, 0] = -weight * (axes[:, 1] @ vector.T)
    out[:, 1] = weight * (axes[:, 0] @ vector.T)
    return out


def factor_and_solve(diagonal: Array, upper: Array, right: Array) -> int:
    """Solve the symmetric block-tridiagonal system for all right-hand sides, in place; count its negative eigenvalues."""
    from scipy.linalg import eigvals_banded, solve_banded  # here: 0.1 s that whoever uses the kernels does without
    from scipy.linalg.lapack import dpbtrf

    count, many = len(diagonal), right.shape[2]
    size = 3 * count
    band = np.zeros((11, size))  # band[5 + row - column, column]
    for r in range(3):
        for c in range(3):
            band[5 + r - c, c::3] = diagonal[:, r, c]
            band[5 + r - c - 3, c + 3 :: 3] = upper[:-1, r, c]
            band[5 + c + 3 - r, r : size - 3 : 3] = upper[:-1, r, c]
    right[:] = solve_banded((5, 5), band, right.reshape(size, many), check_finite=False).reshape(count, 3, many)
    _, failed = dpbtrf(band[5:], lower=1)
    negative = 0
    if failed:
        negative = len(eigvals_banded(band[5:], lower=True, select="v", select_range=(-np.inf, 0.0)))
    return negative


def retract(frames: Array, turn: Array) -> Array:
    """Frames turned by the rotation vectors `turn` (n-1, 3) in their own axes, with unit length."""
    half = 0.5 * turn
    angle = np.linalg.norm(half, axis=1, keepdims=True)
    step = np.concatenate([np.sinc(angle / np.pi) * half, np.cos(angle)], axis=1)
    out = _product(frames, step)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    return out


def _product(a: Array, b: Array) -> Array:
    ax, ay, az, aw = a.T
    bx, by, bz, bw = b.T
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=1,
    )


def relative(before: Array, after: Array) -> Array:
    """Relative rotation conj(before) after of every pair of frames (v, 4), with scalar part not negative."""
    rho = _product(before * np.array([-1.0, -1.0, -1.0, 1.0]), after)
    return np.where(rho[:, 3:] < 0, -rho, rho)


class Vertices(NamedTuple):
    """Every node where frames meet, with clamps on one or both sides or without."""

    relative: Array  # (v, 4) rotation from the frame before to the one after
    cells: Array  # (v,) m
    kind: Array  # (v,) `vertices.INNER` or `CLAMP`
    law: Array  # (v, 3) N m^2
    strain: Array  # (v, 3) 1/m, curvature and twist less the natural ones
    after: Array  # (v, 4) frame
    first: Array  # (v,) int, segment before, -1 where a clamp stands for it
    second: Array  # (v,) int, segment after, -1 where a clamp stands for it


def vertices(frames: Array, lengths: Array, elastic: Elastic, clamp_of_node: Array, clamp_frames: Array) -> Vertices:
    """Every vertex of a rod."""
    count = len(lengths)
    inner = np.flatnonzero(clamp_of_node[1:-1] < 0) + 1
    left = np.flatnonzero(clamp_of_node[1:] >= 0) + 1  # clamps with a segment before them
    right = np.flatnonzero(clamp_of_node[:count] >= 0)
    before = np.concatenate([frames[inner - 1], frames[left - 1], clamp_frames[clamp_of_node[right]]])
    after = np.concatenate([frames[inner], clamp_frames[clamp_of_node[left]], frames[right]])
    cells = 0.5 * np.concatenate([lengths[inner - 1] + lengths[inner], lengths[left - 1], lengths[right]])
    law = np.concatenate([elastic.node_law[inner], elastic.law[left - 1], elastic.law[right]])
    bent = np.concatenate([elastic.node_bent[inner], elastic.bent[left - 1], elastic.bent[right]])
    first = np.concatenate([inner - 1, left - 1, np.full(len(right), -1)])
    second = np.concatenate([inner, np.full(len(left), -1), right])
    rho = relative(before, after)
    kind = np.where((first >= 0) & (second >= 0), INNER, CLAMP)
    scale = (2 + 2 * kind) / (cells * np.maximum(kind + rho[:, 3], LEAST))
    strain = scale[:, None] * rho[:, :3] - bent
    return Vertices(rho, cells, kind, law, strain, after, first, second)


def _vertex_terms(at: Vertices) -> tuple[Array, Array, Array, Array, Array]:
    """Gradients and Hessian blocks of every vertex, by the formulas of `vertices`, all vertices at once."""
    rho, cells, law = at.relative, at.cells, at.law
    v, r0 = rho[:, :3], np.maximum(rho[:, 3], LEAST - at.kind)
    inv, factor = 1 / (at.kind + r0), 2 + 2 * at.kind
    sigma = v * inv[:, None]
    moment = law * at.strain
    eye = np.eye(3)
    b = 0.5 * ((r0 * inv)[:, None, None] * eye + _cross(sigma) + _outer(sigma, sigma))
    bt = np.swapaxes(b, 1, 2)
    gb = factor[:, None] * np.einsum("ikj,ik->ij", b, moment)
    ga = -factor[:, None] * np.einsum("ijk,ik->ij", b, moment)
    scale = (factor**2 / cells)[:, None, None]
    kb, kbt = scale * law[:, :, None] * b, scale * law[:, :, None] * bt
    share = 0.25 * factor * inv
    gamma0 = -np.einsum("ij,ij->i", moment, sigma) * share
    gamma = moment * share[:, None]
    cv = np.einsum("ij,ij->i", gamma, v)
    spread = (gamma0 * r0 + cv)[:, None, None] * eye
    half = 0.5 * inv[:, None, None]
    hbb = bt @ kb + half * (_outer(v, gb) + _outer(gb, v)) - spread
    haa = b @ kbt - half * (_outer(v, ga) + _outer(ga, v)) - spread
    second = (cv - gamma0 * r0)[:, None, None] * eye - _cross(gamma0[:, None] * v + r0[:, None] * gamma)
    hab = -b @ kb - half * (_outer(v, gb) - _outer(ga, v)) - (second - _outer(gamma, v) - _outer(v, gamma))
    return ga, gb, haa, hab, hbb


def _outer(a: Array, b: Array) -> Array:
    product: Array = np.einsum("ni,nj->nij", a, b)
    return product


def _cross(a: Array) -> Array:
    out = np.zeros((len(a), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -a[:, 2], a[:, 1], -a[:, 0]
    return out - np.swapaxes(out, 1, 2)


def solve_symmetric(matrix: Array, right: Array) -> tuple[Array, int]:
    """Solution of a symmetric system that need not be definite, and the number of positive eigenvalues of the matrix."""
    if not len(matrix):
        return np.zeros_like(right), 0
    most = np.abs(matrix).max(axis=1)
    scale = 1 / np.sqrt(np.maximum(np.abs(np.diag(matrix)), np.maximum(1e-9 * most, 1e-30 * most.max() + 1e-300)))
    scaled = scale[:, None] * matrix * scale + FLOOR * np.eye(len(matrix))
    positive = int((np.linalg.eigvalsh(scaled) > 0.0).sum())
    return scale[:, None] * np.linalg.solve(scaled, scale[:, None] * right), positive


_GIVEN = {
    function.__name__: function
    for function in (directors, positions, carried_forces, elastic_energy, assemble, columns, factor_and_solve, retract, solve_symmetric)
}
_plain: dict[str, Any] = interpreted({name: item for name, item in vars(kernels).items() if hasattr(item, "py_func")}, _GIVEN)
begin_stiffness, descend, kick = _plain["begin_stiffness"], _plain["descend"], _plain["kick"]
settle, newton_step, unbalanced = _plain["settle"], _plain["newton_step"], _plain["unbalanced"]
linear_system, border_rows, border_columns = _plain["linear_system"], _plain["border_rows"], _plain["border_columns"]
look, node_forces, energy = _plain["look"], _plain["node_forces"], _plain["energy"]
interpolate_frames, smallest_stiffness = _plain["interpolate_frames"], _plain["smallest_stiffness"]
frames_along, sagging_tangents, turn_onto = _plain["frames_along"], _plain["sagging_tangents"], _plain["turn_onto"]
close, contact_geometry = _plain["close"], _plain["contact_geometry"]
section_forces, twist_of = _plain["section_forces"], _plain["twist_of"]
