"""Coulomb's friction between strands and cables: the points that were held together, and the force that is against their slip.

Where two surfaces touched when the last step had settled, a point of each was held: the knot of `knots`, whose arms a and b reach from the
axes at the material points to the common point and turn with the directors. With n the normal of now,

    u = (1 - n n^T) (p - q),    p = r(s) + R a,    q = r(t) + S b,

is the slip: zero also where both cables turn together, or roll on each other. The law is that of `drag`, f = -u / c up to mu N, with N the
push of the one-sided row, and mu N against u beyond it. f acts at p, and its opposite at q, so that it also turns the cables by their
arms. Rows are taken along two directions across n. That these turn with n is left out of the step, not of what is solved: they are
those of now in every iteration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from types import ModuleType
from typing import Final

import msgspec
import numpy as np

from protocol.messages import Crossings

from . import knots
from .crossing import Met
from .knots import Knots
from .mesh import Mesh
from .rod import NO_RUB, RUB, Rod, Rub
from .strand_rows import Spread

Array = np.ndarray
COULOMB: Final = -1  # no table


@dataclass(frozen=True)
class Rubs:
    """The one-sided rows that rub, on given meshes."""

    row: Array  # (f,) int, which of the one-sided rows
    held: Knots  # the points that were held together
    mu: Array  # (f,)

    def those(self, chosen: Array) -> Rubs:
        """Some of them, by their numbers."""
        parts = {field.name: getattr(self.held, field.name)[chosen] for field in fields(Knots)}
        return Rubs(self.row[chosen], Knots(**parts), self.mu[chosen])

    def pressed(self, met: Met, push: Array) -> Array:
        """The numbers of those that push (k,) [N], or would be in each other; what closes in a step rubs from the next one on."""
        return np.flatnonzero((push[self.row] > 0.0) | (met.gap[self.row] <= 0.0))

    def ahead(self, drag: Array, axes: Sequence[Array]) -> Rubs:
        """With the arms turned by what the couples on them bring."""
        return replace(self, held=knots.ahead(self.held, _pulls(drag), axes))


def rubs(asked: Crossings, chosen: Array, meshes: Sequence[Mesh], rods: Sequence[Rod]) -> tuple[Rubs, Array]:
    """Those of the one-sided rows `chosen` (k,) of a request that rub, and their friction (f, 3) [N] to start from."""
    row = np.flatnonzero(asked.mu[chosen] > 0.0)
    points = msgspec.structs.replace(asked, s=asked.held, force=asked.drag)
    held, pull = knots.knots(points, chosen[row], meshes, rods)
    return Rubs(row, held, asked.mu[chosen[row]]), pull[:, :3]


def laws(own: Rubs, others: Sequence[Rub]) -> Rub:
    """The laws of contacts with bodies (of every rod), then of these, as one."""
    rows = np.zeros(len(own.row), dtype=RUB)
    rows["coefficient"], rows["table"] = own.mu, COULOMB
    tables = [rub.tables for rub in others]
    every, at, parts = _stacked(tables), 0, []
    for rub in others:
        part = rub.rows.copy()
        part["table"] += np.where(part["table"] >= 0, at, 0)
        at += len(rub.tables)
        parts.append(part)
    steps = [rub.time_step for rub in others if len(rub.rows)]
    return Rub(np.concatenate([*parts, rows]), every, steps[0] if steps else NO_RUB.time_step)


def across(own: Rubs, met: Met) -> Array:
    """Two directions across the normal of each of them (f, 2, 3)."""
    return np.array([np.linalg.svd(n[None])[2][1:] for n in met.normal[own.row]]).reshape(-1, 2, 3)


def slips(path: ModuleType, own: Rubs, ways: Array, nodes: Sequence[Array], axes: Sequence[Array]) -> Array:
    """How far the held points have gone from each other along those directions (f, 2) [m]."""
    points = knots.points(path, own.held, nodes, axes)
    return np.asarray(np.einsum("fax,fx->fa", ways, points[:, 0] - points[:, 1]))


def flat(drag: Array, ways: Array) -> Array:
    """Forces (f, 3) [N] without their part along the normals of now."""
    return np.asarray(np.einsum("fax,fa->fx", ways, np.einsum("fax,fx->fa", ways, drag)))


def add_forces(path: ModuleType, own: Rubs, drag: Array, axes: Sequence[Array], forces: Sequence[Array], couples: Sequence[Array]) -> None:
    """Add friction [N] to the forces on the nodes (n, 3) of every cable, and the slopes of its arms [N m] to (n-1, 3)."""
    knots.add_forces(path, own.held, _pulls(drag), axes, forces, couples)


def curve(own: Rubs, drag: Array, axes: Sequence[Array], blocks: Sequence[Array]) -> None:
    """Take the second derivative of its work [N m] with the turns of one segment off the blocks (n-1, 3, 3) of every cable."""
    knots.curve(own.held, _pulls(drag), axes, blocks)


def compliance(own: Rubs, ways: Array, axes: Sequence[Array]) -> Array:
    """By how much more the points slip for forces that grow, as `Rubs.ahead` has it (2 f, 2 f) [m/N]."""
    many = len(own.row)
    whole = knots.compliance(own.held, axes).reshape(many, knots.ROWS, many, knots.ROWS)[:, :3, :, :3]
    return np.asarray(np.einsum("fax,fxgy,gby->fagb", ways, whole, ways).reshape(2 * many, 2 * many))


def columns(path: ModuleType, own: Rubs, ways: Array, axes: Sequence[Array], rods: Sequence[Rod]) -> list[Array]:
    """Columns (n-1, 3, 2 f) of the slips, of every rod."""
    strips, turns = knots.strips(path, own.held, axes, 0)
    out = []
    for rod, strip, turned, frames in zip(rods, strips, turns, axes, strict=True):
        whole = np.zeros((len(frames), 3, knots.ROWS * len(own.row)))
        path.add_spread(frames, rod.lengths, rod.base, Spread(strip.row, strip.node, strip.coef), whole)
        for segment, row, slope in turned:
            whole[segment, :, row] += slope
        parts = whole.reshape(len(frames), 3, len(own.row), knots.ROWS)[..., :3]
        out.append(np.einsum("jkfx,fax->jkfa", parts, ways).reshape(len(frames), 3, -1))
    return out


def strays(own: Rubs, slip: Array, drag: Array, push: Array, hard: float) -> tuple[float, float, Array]:
    """How far they are from their law: largest stray of one that sticks [m], wrong force of one that slides [N]; which stick (f,).

    Args:
        own: The rows.
        slip: (f, 2) [m].
        drag: (f, 2) [N].
        push: (k,) [N] Of all one-sided rows.
        hard: [m/N] Compliance of what sticks.
    """
    limit, size = own.mu * push[own.row], np.linalg.norm(drag, axis=1)
    far = np.linalg.norm(slip, axis=1)
    sticks = (limit > 0.0) & (far <= hard * limit * (1.0 + 1e-9))
    stray = np.linalg.norm(slip + hard * drag, axis=1)[sticks].max(initial=0.0)
    slides = (limit > 0.0) & ~sticks
    wrong = np.linalg.norm(drag + (limit / np.maximum(far, 1e-300))[:, None] * slip, axis=1)[slides].max(initial=0.0)
    return float(stray), float(max(wrong, size[limit <= 0.0].max(initial=0.0))), sticks


def _pulls(drag: Array) -> Array:
    """Forces (f, 3) [N] as those of knots that nothing keeps upright."""
    return np.pad(drag, ((0, 0), (0, knots.ROWS - 3)))


def _stacked(tables: Sequence[Array]) -> Array:
    """Tables (t, 1 + k, 1 + q) of any sizes as one array, filled up with NaN as they are (`rod.Rub`)."""
    most = np.max([table.shape[1:] for table in tables], axis=0)
    padded = [np.pad(t, ((0, 0), (0, most[0] - t.shape[1]), (0, most[1] - t.shape[2])), constant_values=np.nan) for t in tables]
    return np.ascontiguousarray(np.concatenate(padded))
