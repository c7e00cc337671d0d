"""The same functions as in `kernels`, without a compiler: serves until the kernels are compiled, and checks them.

What costs most is written here for numpy and LAPACK, all segments at once; the rest is the very source of the compiled functions,
run by Python. Every function takes and returns exactly what its namesake does; the physics is explained there.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from . import kernels
from .interpreted import interpreted
from .numpy_vertices import add_smoothing, assemble, elastic_energy, product, smoothing_energy
from .schur import Schur
from .symmetric import FLOOR

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
    return eliminate(diagonal, upper, np.zeros((0, 3, 3)), right)


def eliminate(diagonal: Array, upper: Array, beyond: Array, right: Array) -> int:
    """The same with blocks beyond the upper ones, if there are any."""
    from scipy.linalg import eigvals_banded, solve_banded  # here: 0.1 s that whoever uses the kernels does without
    from scipy.linalg.lapack import dpbtrf

    count, many = len(diagonal), right.shape[2]
    blocks = (diagonal, upper[: count - 1], beyond[: max(count - 2, 0)])[: 3 if len(beyond) else 2]
    size, reach = 3 * count, 3 * len(blocks) - 1
    band = np.zeros((2 * reach + 1, size))  # band[reach + row - column, column]
    for away, block in enumerate(blocks):
        for r in range(3):
            for c in range(3):
                band[reach + r - c - 3 * away, c + 3 * away :: 3] = block[:, r, c]
                band[reach + c + 3 * away - r, r : max(size - 3 * away, 0) : 3] = block[:, r, c]
    right[:] = solve_banded((reach, reach), band, right.reshape(size, many), check_finite=False).reshape(count, 3, many)
    _, failed = dpbtrf(band[reach:], lower=1)
    negative = 0
    if failed:
        negative = len(eigvals_banded(band[reach:], lower=True, select="v", select_range=(-np.inf, 0.0)))
    return negative


def complement(
    diagonal: Array, upper: Array, beyond: Array, matrix: Array, gradient: Array, last: Array, is_turn: Array, compliance: Array
) -> Schur:
    """Eliminate all segments, with every row kept and every column as if it were not zero anywhere."""
    found: Schur = _plain["whole"](diagonal, upper, beyond, matrix, gradient, compliance)
    return found


def turns(schur: Schur, change: Array) -> Array:
    """Turns (n-1, 3) of the segments from what `complement` gives."""
    out: Array = schur.solved[:, :, 1:] @ change - schur.solved[:, :, 0]
    return out


def retract(frames: Array, turn: Array) -> Array:
    """Frames turned by the rotation vectors `turn` (n-1, 3) in their own axes, with unit length."""
    half = 0.5 * turn
    angle = np.linalg.norm(half, axis=1, keepdims=True)
    step = np.concatenate([np.sinc(angle / np.pi) * half, np.cos(angle)], axis=1)
    out = product(frames, step)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    return out


def solve_symmetric(matrix: Array, right: Array) -> tuple[Array, int]:
    """Solution of a symmetric system that need not be definite, and the number of positive eigenvalues of the matrix."""
    if not len(matrix):
        return np.zeros_like(right), 0
    most = np.abs(matrix).max(axis=1)
    scale = 1 / np.sqrt(np.maximum(np.abs(np.diag(matrix)), np.maximum(1e-9 * most, 1e-30 * most.max() + 1e-300)))
    scaled = scale[:, None] * matrix * scale + FLOOR * np.eye(len(matrix))
    if not np.isfinite(scaled).all():  # LAPACK would raise
        return np.full_like(right, np.nan), 0
    positive = int((np.linalg.eigvalsh(scaled) > 0.0).sum())
    return scale[:, None] * np.linalg.solve(scaled, scale[:, None] * right), positive


def condense(matrix: Array, right: Array, fixed: Array, free: Array) -> tuple[Array, Array, Array, int]:
    """A symmetric system with the unknowns `fixed` eliminated."""
    both = np.column_stack([matrix[np.ix_(fixed, free)], right[fixed]])
    solved, positive = solve_symmetric(matrix[np.ix_(fixed, fixed)], both)
    coupling = matrix[np.ix_(free, fixed)]
    return matrix[np.ix_(free, free)] - coupling @ solved[:, :-1], right[free] - coupling @ solved[:, -1], solved, positive


_GIVEN = {
    function.__name__: function
    for function in (
        directors,
        positions,
        carried_forces,
        elastic_energy,
        assemble,
        smoothing_energy,
        add_smoothing,
        columns,
        factor_and_solve,
        eliminate,
        complement,
        turns,
        retract,
        solve_symmetric,
        condense,
    )
}
_plain: dict[str, Any] = interpreted({name: item for name, item in vars(kernels).items() if hasattr(item, "py_func")}, _GIVEN)
begin_stiffness, iterate, kick = _plain["begin_stiffness"], _plain["iterate"], _plain["kick"]
descend = _plain["descend"]
settle, settle_on, keeps_laws = _plain["settle"], _plain["settle_on"], _plain["keeps_laws"]
newton_step, unbalanced, farthest_off = _plain["newton_step"], _plain["unbalanced"], _plain["farthest_off"]
mend, lacking = _plain["mend"], _plain["lacking"]
linear_system, border_rows, border_columns = _plain["linear_system"], _plain["border_rows"], _plain["border_columns"]
look, node_forces, energy = _plain["look"], _plain["node_forces"], _plain["energy"]
interpolate_frames, smallest_stiffness = _plain["interpolate_frames"], _plain["smallest_stiffness"]
frames_along, sagging_tangents, turn_onto = _plain["frames_along"], _plain["sagging_tangents"], _plain["turn_onto"]
close, contact_geometry, add_couples = _plain["close"], _plain["contact_geometry"], _plain["add_couples"]
close_with_friction, stick_slip = _plain["close_with_friction"], _plain["stick_slip"]
drag_limit, normal_forces = _plain["drag_limit"], _plain["normal_forces"]
add_spread, curvature, apart = _plain["add_spread"], _plain["curvature"], _plain["apart"]
shares, slide, fix_gauge = _plain["shares"], _plain["slide"], _plain["fix_gauge"]
advance, worst_miss, whole, work_of = _plain["advance"], _plain["worst_miss"], _plain["whole"], _plain["work_of"]
section_forces, twist_of = _plain["section_forces"], _plain["twist_of"]
