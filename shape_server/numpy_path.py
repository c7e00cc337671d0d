"""The same functions as in `kernels`, in plain numpy and LAPACK: serves until the kernels are compiled, and checks them.

Every function here takes and returns exactly what its namesake does; the physics is explained there.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigvals_banded, solve_banded
from scipy.linalg.lapack import dpbtrf

from . import closing
from . import contact_geometry as geometry
from .interpreted import interpreted

Array = np.ndarray

contact_geometry = interpreted(geometry.contact_geometry)
close = interpreted(closing.close)


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


def elastic_energy(frames: Array, lengths: Array, law: Array, clamp_of_node: Array, clamp_frames: Array) -> float:
    """Energy of bending and twist [J]."""
    before, after, cells, _, _ = vertices(frames, lengths, clamp_of_node, clamp_frames)
    rho = relative(before, after)
    sigma = rho[:, :3] / (1 + rho[:, 3:])
    return float((8 / cells * ((sigma * sigma) @ law)).sum())


def assemble(
    frames: Array, axes: Array, lengths: Array, law: Array, clamp_of_node: Array, clamp_frames: Array, carried: Array
) -> tuple[Array, Array, Array]:
    """Gradient (n-1, 3), diagonal (n-1, 3, 3) and upper blocks (n-1, 3, 3) of energy less the work of the forces."""
    count = len(lengths)
    local = np.einsum("jkx,jx->jk", axes, carried) * lengths[:, None]
    gradient = np.stack([local[:, 1], -local[:, 0], np.zeros(count)], axis=1)
    diagonal = np.zeros((count, 3, 3))
    diagonal[:, 0, 0] = diagonal[:, 1, 1] = local[:, 2]
    diagonal[:, 0, 2] = diagonal[:, 2, 0] = -0.5 * local[:, 0]
    diagonal[:, 1, 2] = diagonal[:, 2, 1] = -0.5 * local[:, 1]
    upper = np.zeros((count, 3, 3))
    before, after, cells, first, second = vertices(frames, lengths, clamp_of_node, clamp_frames)
    ga, gb, haa, hab, hbb = _vertex_terms(before, after, cells, law)
    has_first, has_second = first >= 0, second >= 0
    np.add.at(gradient, first[has_first], ga[has_first])
    np.add.at(gradient, second[has_second], gb[has_second])
    np.add.at(diagonal, first[has_first], haa[has_first])
    np.add.at(diagonal, second[has_second], hbb[has_second])
    inner = has_first & has_second
    upper[first[inner]] = hab[inner]
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


def factor_and_solve(diagonal: Array, upper: Array, right: Array) -> tuple[Array, int]:
    """Solve the symmetric block-tridiagonal system for all right-hand sides; count its negative eigenvalues."""
    count, many = len(diagonal), right.shape[2]
    size = 3 * count
    band = np.zeros((11, size))  # band[5 + row - column, column]
    for r in range(3):
        for c in range(3):
            band[5 + r - c, c::3] = diagonal[:, r, c]
            band[5 + r - c - 3, c + 3 :: 3] = upper[:-1, r, c]
            band[5 + c + 3 - r, r : size - 3 : 3] = upper[:-1, r, c]
    solution = solve_banded((5, 5), band, right.reshape(size, many)).reshape(count, 3, many)
    _, failed = dpbtrf(band[5:], lower=1)
    negative = 0
    if failed:
        negative = len(eigvals_banded(band[5:], lower=True, select="v", select_range=(-np.inf, 0.0)))
    return solution, negative


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


def vertices(frames: Array, lengths: Array, clamp_of_node: Array, clamp_frames: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Every vertex: frames before and after, cell, and the segments they belong to (-1 for a clamp)."""
    count = len(lengths)
    inner = np.flatnonzero(clamp_of_node[1:-1] < 0) + 1
    left = np.flatnonzero(clamp_of_node[1:] >= 0) + 1  # clamps with a segment before them
    right = np.flatnonzero(clamp_of_node[:count] >= 0)
    before = np.concatenate([frames[inner - 1], frames[left - 1], clamp_frames[clamp_of_node[right]]])
    after = np.concatenate([frames[inner], clamp_frames[clamp_of_node[left]], frames[right]])
    cells = 0.5 * np.concatenate([lengths[inner - 1] + lengths[inner], lengths[left - 1], lengths[right]])
    first = np.concatenate([inner - 1, left - 1, np.full(len(right), -1)])
    second = np.concatenate([inner, np.full(len(left), -1), right])
    return before, after, cells, first, second


def _vertex_terms(before: Array, after: Array, cells: Array, law: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Gradients and Hessian blocks of every vertex, by the formulas of `kernels`, all vertices at once."""
    rho = relative(before, after)
    v, r0 = rho[:, :3], rho[:, 3]
    inv = 1 / (1 + r0)
    sigma = v * inv[:, None]
    moment = 4 * law * sigma / cells[:, None]
    eye = np.eye(3)
    b = 0.25 * (1 - np.einsum("ij,ij->i", sigma, sigma))[:, None, None] * eye + 0.5 * (_cross(sigma) + _outer(sigma, sigma))
    bt = np.swapaxes(b, 1, 2)
    gb = 4 * np.einsum("ikj,ik->ij", b, moment)
    ga = -4 * np.einsum("ijk,ik->ij", b, moment)
    scale = (16 / cells)[:, None, None]
    kb, kbt = scale * law[:, None] * b, scale * law[:, None] * bt
    gamma0 = -np.einsum("ij,ij->i", moment, sigma) * inv
    gamma = moment * inv[:, None]
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
