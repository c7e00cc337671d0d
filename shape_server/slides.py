"""What a cable without bending is held by: points where it is held, and contacts that it slides over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from protocol.messages import Contacts, Start

from .contact_geometry import EDGE


@dataclass(frozen=True, eq=False)
class Slide:
    """A contact that the cable slides over: the rows of the request that are about one point or edge."""

    rows: np.ndarray  # (r,) int, in the request
    point: np.ndarray  # (3,) m
    direction: np.ndarray  # (3,) unit along an edge, zero for a point
    extent: np.ndarray  # (2,) m, from the point along the edge
    distance: float  # m
    normal: np.ndarray  # (3,) when it was found
    s: float  # m, where the cable touches it
    along: float  # m, from the point along the edge
    offset: np.ndarray  # (3,) m, from the feature to the bend of the cable
    hand: np.ndarray  # (3,) tangent x normal when it was found; zero where no start shape says the tangent

    @property
    def place(self) -> np.ndarray:
        """Where the cable bends (3,) [m]."""
        at: np.ndarray = self.point + self.along * self.direction + self.offset
        return at


@dataclass(frozen=True, eq=False)
class Hold:
    """A point of the cable that is held where it is."""

    s: float  # m
    place: np.ndarray  # (3,) m


class Bend(NamedTuple):
    """Tangents (3,) of a cable before and after a sharp bend."""

    before: np.ndarray
    after: np.ndarray


def slides_of(contacts: Contacts, rows: list[int], start: Start | None) -> Slide:
    """One contact from its rows, at the one that pushes most; if none does, where its normal is most nearly square to the cable."""
    push, tangents = np.einsum("ij,ij->i", contacts.force[rows], contacts.normal[rows]), np.zeros((len(rows), 3))
    if start is not None:
        segment = np.clip(np.searchsorted(start.s, contacts.s[rows]) - 1, 0, len(start.frames) - 1)
        x, y, z, w = start.frames[segment].T
        tangents = np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    if start is not None and not push.any():
        push = -np.abs(np.einsum("ij,ij->i", tangents, contacts.normal[rows]))
    best = int(np.argmax(push))
    first = rows[best]
    normal = contacts.normal[first]
    return Slide(
        rows=np.array(rows),
        point=contacts.point[first],
        direction=contacts.direction[first] * (contacts.feature[first] == EDGE),
        extent=contacts.extent[first],
        distance=float(contacts.distance[first]),
        normal=normal,
        s=float(contacts.s[first]),
        along=0.0,
        offset=float(contacts.distance[first]) * normal,
        hand=np.cross(tangents[best], normal),
    )
