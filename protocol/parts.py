"""What messages are made of: boundary conditions of a cable and the shape that answers them, checked when they are made."""

from __future__ import annotations

import msgspec
import numpy as np

from .checks import (
    CONTACTS_MAX,
    EXTENT_MAX,
    GRASPS_MAX,
    HUGE,
    NODES_MAX,
    check_cable,
    check_count,
    check_floats,
    check_integers,
    check_quaternions,
    check_units,
)
from .errors import MessageError
from .kinds import FRICTION_CODES, Feature, Hold, Outcome
from .scene import Cable


class Part(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Anything that crosses the wire inside a message."""


class Grasps(Part, frozen=True):
    """Held points of one cable, in the order of growing arc length."""

    s: np.ndarray  # (g,) m, arc length; strictly increasing
    position: np.ndarray  # (g, 3) m
    quaternion: np.ndarray  # (g, 4) frame of the cable there; d3 is the tangent
    hold: tuple[Hold, ...]  # (g,)

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.hold)
        check_count("grasps", count, GRASPS_MAX)
        check_floats("grasps.s", self.s, (count,), EXTENT_MAX)
        check_floats("grasps.position", self.position, (count, 3), EXTENT_MAX)
        check_quaternions("grasps.quaternion", self.quaternion, count)
        if count > 1 and not (np.diff(self.s) > 0).all():
            raise MessageError("grasps.s: must grow strictly; order the grasps along the cable", key="grasps.s")


class Contacts(Part, frozen=True):
    """Places where a cable touches a body or may do so, one row each.

    A row holds the cable's axis at least `distance` from a feature of a body: from the plane through `point` square to
    `normal` (face), from the line through `point` along `direction` (edge), or from `point` itself (vertex).
    """

    s: np.ndarray  # (m,) m, arc length of the nearest point of the cable
    body: np.ndarray  # (m,) int, index of the body in the scene; -1 for none
    feature: np.ndarray  # (m,) int, a `Feature`
    point: np.ndarray  # (m, 3) m, nearest point of the body
    normal: np.ndarray  # (m, 3) unit, from the body to the cable
    direction: np.ndarray  # (m, 3) unit, along the edge; zero for faces and vertices
    extent: np.ndarray  # (m, 2) m, from `point` back and on along `direction` as far as the edge goes; zero if no edge
    distance: np.ndarray  # (m,) m, between axis and feature when they touch
    friction: np.ndarray  # (m,) int, index into `kinds.FRICTION_CODES`
    force: np.ndarray  # (m, 3) N, on the cable; what to start from

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.s)
        check_count("contacts", count, CONTACTS_MAX)
        for name, low, high in (("body", -1, 10_000), ("feature", 0, len(Feature) - 1), ("friction", 0, len(FRICTION_CODES) - 1)):
            check_integers(f"contacts.{name}", getattr(self, name), count, low, high)
        for name in ("s", "distance"):
            check_floats(f"contacts.{name}", getattr(self, name), (count,), EXTENT_MAX)
        for name in ("point", "normal", "direction"):
            check_floats(f"contacts.{name}", getattr(self, name), (count, 3), EXTENT_MAX)
        check_floats("contacts.extent", self.extent, (count, 2), EXTENT_MAX)
        check_floats("contacts.force", self.force, (count, 3), 1e9)
        check_units("contacts.normal", self.normal)
        check_units("contacts.direction", self.direction[self.feature == Feature.EDGE])


class Start(Part, frozen=True):
    """Shape to start from: the frame of every segment, and the forces that held it."""

    s: np.ndarray  # (n,) m, arc length of every node, from 0 to the cable's length
    frames: np.ndarray  # (n-1, 4) quaternion of every segment
    grasp_forces: np.ndarray  # (g, 3) N, on the cable

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.s)
        check_count("start", count, NODES_MAX)
        check_floats("start.s", self.s, (count,), EXTENT_MAX)
        check_quaternions("start.frames", self.frames, count - 1)
        check_floats("start.grasp_forces", self.grasp_forces, (len(self.grasp_forces), 3), 1e9)
        if count < 2 or not (np.diff(self.s) > 0).all():
            raise MessageError("start.s: must grow strictly and have two nodes or more", key="start.s")


class Problem(Part, frozen=True):
    """One cable with its boundary conditions."""

    cable: Cable
    grasps: Grasps
    contacts: Contacts | None = None
    start: Start | None = None  # without it: a cold start

    def __post_init__(self) -> None:
        """Check the cable, and what goes together."""
        check_cable(self.cable)
        length, s = self.cable.length, self.grasps.s
        if not len(s) or s[0] < 0 or s[-1] > length:
            raise MessageError(f"grasps.s: must have an entry or more, all from 0 to the cable's length, {length:g} m", key="grasps.s")
        if len(s) > 1 and np.diff(s).min() < 1e-6 * length:
            raise MessageError(
                f"grasps.s: two grasps are closer than {1e-6 * length:g} m along the cable; hold it at two places", key="grasps.s"
            )
        if self.contacts is not None and len(self.contacts.s) and not 0 <= self.contacts.s.min() <= self.contacts.s.max() <= length:
            raise MessageError(f"contacts.s: must lie from 0 to the cable's length, {length:g} m", key="contacts.s")
        if self.start is not None and len(self.start.grasp_forces) != len(s):
            raise MessageError(
                f"start.grasp_forces: has {len(self.start.grasp_forces)} rows for {len(s)} grasps; give one each", key="start.grasp_forces"
            )


class Cost(Part, frozen=True):
    """What an answer cost, in seconds of wall time by part."""

    solve: float  # equilibrium iterations, stability included
    estimate: float  # error estimate
    path: str  # "numba", "numpy", "closed form" or "none"


class Shape(Part, frozen=True):
    """A predicted shape with its price tag."""

    s: np.ndarray  # (n,) m, arc length of every node
    nodes: np.ndarray  # (n, 3) m
    frames: np.ndarray  # (n-1, 4) quaternion of every segment; d3 points from node to node
    tension: np.ndarray  # (n-1,) N, in every segment; negative where the cable is compressed
    curvature: np.ndarray  # (n,) 1/m, of bending, at every node
    grasp_wrenches: np.ndarray  # (g, 6) N and N m, on the cable at every grasp, force then moment
    contact_forces: np.ndarray  # (m, 3) N, on the cable, in the order of the request's contacts
    contact_s: np.ndarray  # (m,) m, where along the cable each contact has slid to
    outcome: Outcome
    sentence: str  # how it ended
    model: str  # "rod" or "catenary"
    effects: tuple[str, ...]  # simulated
    error: float | None  # m, estimated error of the node positions; None where the outcome is no shape
    residual: float  # N, largest unbalanced force
    iterations: int
    is_stable: bool  # certified from the inertia of the system, in three dimensions
    cost: Cost

    def __post_init__(self) -> None:
        """Check shapes and ranges; an outcome without a shape has empty arrays."""
        nodes, grasps, contacts = len(self.s), len(self.grasp_wrenches), len(self.contact_s)
        segments = max(nodes - 1, 0)
        check_count("shape", nodes, NODES_MAX)
        for name, shape, most in (
            ("s", (nodes,), EXTENT_MAX),
            ("nodes", (nodes, 3), EXTENT_MAX),
            ("tension", (segments,), HUGE),
            ("curvature", (nodes,), HUGE),
            ("grasp_wrenches", (grasps, 6), HUGE),
            ("contact_forces", (contacts, 3), HUGE),
            ("contact_s", (contacts,), EXTENT_MAX),
        ):
            check_floats(f"shape.{name}", getattr(self, name), shape, most)
        check_quaternions("shape.frames", self.frames, segments)
