"""Where a cable passes a touched edge or vertex a second time, too near, and no contact was given there.

A contact says at which place along the cable a feature is met, and the cable is kept off the feature there and beside. With its other
leg it may pass the same edge elsewhere: whoever looks for contacts finds that in the shape (as `env_server` does) and adds one. The
shape has to say so, or it would be taken for one that is clear of all that it was asked to touch.
"""

from __future__ import annotations

import numpy as np

from protocol.kinds import Feature
from protocol.messages import Contacts

Array = np.ndarray


def trespass(contacts: Contacts, s: Array, nodes: Array) -> tuple[float, float, int]:
    """How much too near a cable comes to an edge or a vertex [m], where along the cable [m], and which contact's feature that is.

    Args:
        contacts: What it was asked to touch.
        s: (n,) [m].
        nodes: (n, 3) [m].

    Returns:
        Zero and no contact, -1, if it is clear of all of them.
    """
    chosen = np.flatnonzero(contacts.feature != Feature.FACE)
    if not len(chosen):
        return 0.0, 0.0, -1
    point, along, extent = contacts.point[chosen], contacts.direction[chosen], contacts.extent[chosen]
    # Only segments with a node nearer to the line than that segment is long can pass it.
    q, r, size = nodes - point[0], point - point[0], (s[1:] - s[:-1])[:, None]
    square = _dot(q, q)[:, None] - 2.0 * q @ r.T + _dot(r, r)
    away = square - (q @ along.T - _dot(r, along)) ** 2
    near = np.minimum(away[:-1], away[1:]) < (contacts.distance[chosen] + size) ** 2
    segment, k = np.nonzero(near)
    if not len(segment):
        return 0.0, 0.0, -1
    begin, middle = point[k] + extent[k, :1] * along[k], (extent[k, 1:] - extent[k, :1]) * along[k]
    distance, share = _apart(nodes[segment], nodes[segment + 1] - nodes[segment], begin, middle)
    inside = contacts.distance[chosen][k] - distance
    worst = int(np.argmax(inside))
    if inside[worst] <= 0.0:
        return 0.0, 0.0, -1
    place = s[segment[worst]] + share[worst] * (s[segment[worst] + 1] - s[segment[worst]])
    return float(inside[worst]), float(place), int(chosen[k[worst]])


def _apart(a: Array, u: Array, b: Array, v: Array) -> tuple[Array, Array]:
    """Distances (k,) [m] of segments a + x u and b + y v, rows (k, 3) each, and x (k,); v may be zero."""
    w = a - b
    uu, uv, vv = _dot(u, u), _dot(u, v), np.maximum(_dot(v, v), 1e-300)
    uw, vw = _dot(u, w), _dot(v, w)
    det = uu * vv - uv * uv
    x = np.where(det > 1e-12 * uu * vv, _share((uv * vw - vv * uw) / np.where(det > 0.0, det, 1.0)), 0.0)
    y = _share((vw + x * uv) / vv)
    x = _share((y * uv - uw) / uu)
    apart = w + x[:, None] * u - y[:, None] * v
    return np.sqrt(_dot(apart, apart)), x


def _share(x: Array) -> Array:
    """Within 0 and 1; for arrays this short np.clip takes thrice as long."""
    return np.asarray(np.minimum(np.maximum(x, 0.0), 1.0))


def _dot(first: Array, second: Array) -> Array:
    """Scalar products (k,) of rows (k, 3)."""
    return np.asarray(np.einsum("kx,kx->k", first, second))
