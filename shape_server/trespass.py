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
    x, y, z = (nodes[:, k, None] - point[:, k] for k in range(3))  # (n, m) each: an axis of three would cost five times as much
    away = x * x + y * y + z * z - (x * along[:, 0] + y * along[:, 1] + z * along[:, 2]) ** 2
    near = np.minimum(away[:-1], away[1:]) < (contacts.distance[chosen] + np.diff(s)[:, None]) ** 2
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
    uu, uv, vv = (u * u).sum(axis=1), (u * v).sum(axis=1), np.maximum((v * v).sum(axis=1), 1e-300)
    uw, vw = (u * w).sum(axis=1), (v * w).sum(axis=1)
    det = uu * vv - uv * uv
    x = np.where(det > 1e-12 * uu * vv, np.clip((uv * vw - vv * uw) / np.where(det > 0.0, det, 1.0), 0.0, 1.0), 0.0)
    y = np.clip((vw + x * uv) / vv, 0.0, 1.0)
    x = np.clip((y * uv - uw) / uu, 0.0, 1.0)
    apart = w + x[:, None] * u - y[:, None] * v
    return np.sqrt((apart * apart).sum(axis=1)), x
