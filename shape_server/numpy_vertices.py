"""Vertices of the rod for numpy, all at once: what `vertices` and `smoothing` do node by node, for `numpy_path`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .rod import Elastic
from .vertices import CLAMP, INNER, LEAST

Array = np.ndarray


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
    _add_vertices(at, gradient, diagonal, upper)
    return gradient, diagonal, upper


def _add_vertices(at: Vertices, gradient: Array, diagonal: Array, upper: Array) -> None:
    ga, gb, haa, hab, hbb = _vertex_terms(at)
    has_first, has_second = at.first >= 0, at.second >= 0
    np.add.at(gradient, at.first[has_first], ga[has_first])
    np.add.at(gradient, at.second[has_second], gb[has_second])
    np.add.at(diagonal, at.first[has_first], haa[has_first])
    np.add.at(diagonal, at.second[has_second], hbb[has_second])
    inner = has_first & has_second
    upper[at.first[inner]] += hab[inner]


def smoothing_energy(frames: Array, lengths: Array, elastic: Elastic, clamp_of_node: Array, clamp_frames: Array) -> float:
    """Energy of the ties [J]."""
    strain, ties = _tied(vertices(frames, lengths, elastic, clamp_of_node, clamp_frames), lengths, elastic, clamp_of_node)
    return float((0.5 * ties * (strain[:, 1] - strain[:, 0]) ** 2).sum())


def _tied(at: Vertices, lengths: Array, elastic: Elastic, clamp_of_node: Array) -> tuple[Array, Array]:
    strain, ties = np.zeros((len(lengths), 2, 2)), elastic.smoothing.copy()
    for side, segment in enumerate((at.second, at.first)):
        strain[segment[segment >= 0], side] = at.strain[segment >= 0, :2]
    for end in (0, -1):
        if clamp_of_node[end] < 0:
            ties[end] = 1 / (1 / ties[end] + 2 / (elastic.law[end, :2] * lengths[end]))
    return strain, ties


def add_smoothing(
    frames: Array,
    lengths: Array,
    elastic: Elastic,
    clamp_of_node: Array,
    clamp_frames: Array,
    gradient: Array,
    diagonal: Array,
    upper: Array,
) -> Array:
    """Add the ties to gradient and blocks; the blocks beyond them."""
    at = vertices(frames, lengths, elastic, clamp_of_node, clamp_frames)
    strain, ties = _tied(at, lengths, elastic, clamp_of_node)
    law, pull = np.zeros((len(at.cells), 3)), np.zeros((len(at.cells), 3))
    slope = np.zeros((len(lengths), 2, 2, 2, 3))  # segment, end, frame, axis, turn
    turning, scale = _turning(at), ((2 + 2 * at.kind) / at.cells)[:, None, None]
    by_frame = np.stack([-np.swapaxes(turning, 1, 2)[:, :2], turning[:, :2]], axis=1) * scale[:, None]
    by_frame[at.first < 0, 0] = by_frame[at.second < 0, 1] = 0.0
    for side, segment in enumerate((at.second, at.first)):
        own = segment >= 0
        j = segment[own]
        law[own, :2] += ties[j]
        pull[own, :2] += ties[j] * (strain[j, side] - strain[j, 1 - side])
        slope[j, side] = by_frame[own]
    spring = at._replace(law=law / at.cells[:, None], strain=pull / np.where(law > 0.0, law, 1.0))
    _add_vertices(spring, gradient, diagonal, upper)
    product = -np.einsum("jpkr,jk,jqkc->jpqrc", slope[:, 0], ties, slope[:, 1])
    diagonal += product[:, 1, 0] + np.swapaxes(product[:, 1, 0], 1, 2)
    upper += product[:, 1, 1]
    upper[:-1] += product[1:, 0, 0]
    return np.concatenate([product[1:, 0, 1], np.zeros((1, 3, 3))])


def relative(before: Array, after: Array) -> Array:
    """Relative rotation conj(before) after of every pair of frames (v, 4), with scalar part not negative."""
    rho = product(before * np.array([-1.0, -1.0, -1.0, 1.0]), after)
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
    eye, b = np.eye(3), _turning(at)
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


def _turning(at: Vertices) -> Array:
    """B of every vertex, (v, 3, 3)."""
    r0 = np.maximum(at.relative[:, 3], LEAST - at.kind)
    inv = 1 / (at.kind + r0)
    sigma = at.relative[:, :3] * inv[:, None]
    return np.asarray(0.5 * ((r0 * inv)[:, None, None] * np.eye(3) + _cross(sigma) + _outer(sigma, sigma)))


def _outer(a: Array, b: Array) -> Array:
    product: Array = np.einsum("ni,nj->nij", a, b)
    return product


def _cross(a: Array) -> Array:
    out = np.zeros((len(a), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -a[:, 2], a[:, 1], -a[:, 0]
    return out - np.swapaxes(out, 1, 2)


def product(a: Array, b: Array) -> Array:
    """Products (v, 4) of quaternions."""
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
