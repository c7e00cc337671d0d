"""Rows of `LANES` numbers, one of every cable, which follow each other in an array of one axis; read and set for one lane; compiled."""

from __future__ import annotations

from .jitted import kernel

LANES = 16  # a multiple of the eight numbers of a vector register


@kernel
def place_nodes(origin, lengths, frames, nodes):  # type: ignore[no-untyped-def]
    """Fill in the nodes (LANES, n, 3) [m] from `origin` (3 LANES) along the frames (n+1, 4 LANES) of clamps and segments."""
    for lane in range(LANES):
        nodes[lane, 0, 0], nodes[lane, 0, 1], nodes[lane, 0, 2] = three(origin, 0, lane)
        for j in range(len(lengths)):
            x, y, z, w = four(frames[j + 1], 0, lane)
            h = lengths[j, lane]
            nodes[lane, j + 1, 0] = nodes[lane, j, 0] + h * 2.0 * (x * z + w * y)
            nodes[lane, j + 1, 1] = nodes[lane, j, 1] + h * 2.0 * (y * z - w * x)
            nodes[lane, j + 1, 2] = nodes[lane, j, 2] + h * (1.0 - 2.0 * (x * x + y * y))


@kernel
def three(rows, at, lane):  # type: ignore[no-untyped-def]
    """Three rows of one lane."""
    return rows[at + lane], rows[at + LANES + lane], rows[at + 2 * LANES + lane]


@kernel
def four(rows, at, lane):  # type: ignore[no-untyped-def]
    """Four rows of one lane."""
    return rows[at + lane], rows[at + LANES + lane], rows[at + 2 * LANES + lane], rows[at + 3 * LANES + lane]


@kernel
def column(rows, at, lane):  # type: ignore[no-untyped-def]
    """Every third row: a column of a matrix (3, 3)."""
    return rows[at + lane], rows[at + 3 * LANES + lane], rows[at + 6 * LANES + lane]


@kernel
def put(rows, at, value, lane):  # type: ignore[no-untyped-def]
    """Set three rows of one lane."""
    rows[at + lane], rows[at + LANES + lane], rows[at + 2 * LANES + lane] = value


@kernel
def add(rows, at, value, lane):  # type: ignore[no-untyped-def]
    """Add to three rows of one lane."""
    rows[at + lane] += value[0]
    rows[at + LANES + lane] += value[1]
    rows[at + 2 * LANES + lane] += value[2]
