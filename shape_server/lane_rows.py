"""Small products of vectors and matrices of one lane, which LLVM inlines into `lanes`; compiled.

Rows of `LANES` numbers, one of every cable, follow each other in an array of one axis; vectors are tuples of numbers.
"""

from __future__ import annotations

from numba import njit

LANES = 16  # a multiple of the eight numbers of a vector register


@njit(cache=True)
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


@njit(cache=True)
def three(rows, at, lane):  # type: ignore[no-untyped-def]
    """Three rows of one lane."""
    return rows[at + lane], rows[at + LANES + lane], rows[at + 2 * LANES + lane]


@njit(cache=True)
def four(rows, at, lane):  # type: ignore[no-untyped-def]
    """Four rows of one lane."""
    return rows[at + lane], rows[at + LANES + lane], rows[at + 2 * LANES + lane], rows[at + 3 * LANES + lane]


@njit(cache=True)
def column(rows, at, lane):  # type: ignore[no-untyped-def]
    """Every third row: a column of a matrix (3, 3)."""
    return rows[at + lane], rows[at + 3 * LANES + lane], rows[at + 6 * LANES + lane]


@njit(cache=True)
def put(rows, at, value, lane):  # type: ignore[no-untyped-def]
    """Set three rows of one lane."""
    rows[at + lane], rows[at + LANES + lane], rows[at + 2 * LANES + lane] = value


@njit(cache=True)
def larger(a, b):  # type: ignore[no-untyped-def]
    """The larger number."""
    return a if a > b else b


@njit(cache=True)
def dot(a, b):  # type: ignore[no-untyped-def]
    """Product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def weighted(a, x, b, y, c, z):  # type: ignore[no-untyped-def]
    """Sum a x + b y + c z of three vectors."""
    return a * x[0] + b * y[0] + c * z[0], a * x[1] + b * y[1] + c * z[1], a * x[2] + b * y[2] + c * z[2]


@njit(cache=True)
def form(k, a, b):  # type: ignore[no-untyped-def]
    """Product a . K b with K = diag(k)."""
    return k[0] * a[0] * b[0] + k[1] * a[1] * b[1] + k[2] * a[2] * b[2]


@njit(cache=True)
def mixed(form, half, vi, vj, ai, bj, ci, cj, p):  # type: ignore[no-untyped-def]
    """Entry of the block of a vertex between its two frames, see `vertices`."""
    return -form - half * (vi * bj - ai * vj) - (p - ci * vj - vi * cj)


@njit(cache=True)
def solved(inverse, inverse_2, r, g0, g1, g2, y):  # type: ignore[no-untyped-def]
    """Symmetric inverse, by its two halves, times r, less the rows g times y."""
    first = inverse[0] * r[0] + inverse[1] * r[1] + inverse[2] * r[2] - dot(g0, y)
    second = inverse[1] * r[0] + inverse_2[0] * r[1] + inverse_2[1] * r[2] - dot(g1, y)
    return first, second, inverse[2] * r[0] + inverse_2[1] * r[1] + inverse_2[2] * r[2] - dot(g2, y)


@njit(cache=True)
def product(a, b):  # type: ignore[no-untyped-def]
    """Of two quaternions."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@njit(cache=True)
def conjugate(a):  # type: ignore[no-untyped-def]
    """Of a quaternion."""
    return -a[0], -a[1], -a[2], a[3]
