"""What messages are made of: boundary conditions of a cable and the shape that answers them, checked when they are made."""

from __future__ import annotations

from typing import Final

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
    is_growing,
)
from .effects import CHOOSABLE, Predicted, check_effects
from .errors import MessageError
from .kinds import FRICTION_CODES, INCLINATION_CODES, RUBS, Feature, Hold, Model, Outcome, SelfTouch
from .part import Part as Part
from .rubbing import Rubbed as Rubbed
from .rubbing import Rubbing as Rubbing
from .scene import Cable

TURNS_MAX: Final = 100
BRANCHES_MAX: Final = 100


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
        if not is_growing(self.s):
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
    rubbing: Rubbing | None = None  # of the contacts whose friction is one of `kinds.RUBS`
    inclination: np.ndarray | None = None  # (m,) int, index into `kinds.INCLINATION_CODES`; None: free everywhere

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.s)
        check_count("contacts", count, CONTACTS_MAX)
        if self.inclination is not None:
            check_integers("contacts.inclination", self.inclination, count, 0, len(INCLINATION_CODES) - 1)
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
        rubs = np.flatnonzero(np.isin(self.friction, RUBS)) if count and self.friction.max() >= RUBS[0] else np.zeros(0, dtype=np.int64)
        if not np.array_equal(rubs, () if self.rubbing is None else self.rubbing.contact):
            raise MessageError("contacts.rubbing: must have a row for every contact whose friction is 2, 3 or 4", key="contacts.rubbing")


class SelfContacts(Part, frozen=True):
    """Places where a cable touches itself or may do so, one row each; see `SelfTouch` for the kinds."""

    s: np.ndarray  # (k, 2) m, arc lengths of both places
    kind: np.ndarray  # (k,) int, a `SelfTouch`
    normal: np.ndarray  # (k, 3) unit, from the second place to the first: which is on which side
    distance: np.ndarray  # (k,) m, between the axes when they touch
    force: np.ndarray  # (k, 3) N, on the first place, and against it on the second; what to start from

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.s)
        check_count("self_contacts", count, CONTACTS_MAX)
        check_integers("self_contacts.kind", self.kind, count, SelfTouch.CONTACT, SelfTouch.CONTACT)
        check_floats("self_contacts.s", self.s, (count, 2), EXTENT_MAX)
        check_floats("self_contacts.normal", self.normal, (count, 3), EXTENT_MAX)
        check_floats("self_contacts.distance", self.distance, (count,), EXTENT_MAX)
        check_floats("self_contacts.force", self.force, (count, 3), 1e9)
        check_units("self_contacts.normal", self.normal)


class SelfReactions(Part, frozen=True):
    """What a cable does to itself, in the order of the request's self-contacts."""

    s: np.ndarray  # (k, 2) m, where both places have slid to
    force: np.ndarray  # (k, 3) N, on the first place; the opposite acts on the second
    gap: np.ndarray  # (k,) m

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        check_floats("self_reactions.s", self.s, (len(self.s), 2), EXTENT_MAX)
        check_floats("self_reactions.force", self.force, (len(self.s), 3), HUGE)
        check_floats("self_reactions.gap", self.gap, (len(self.s),), EXTENT_MAX)


class PointLoads(Part, frozen=True):
    """Forces given at points of the cable, in the world frame; they do not turn with it."""

    s: np.ndarray  # (p,) m, arc length
    force: np.ndarray  # (p, 3) N

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        check_count("loads", len(self.s), CONTACTS_MAX)
        check_floats("loads.s", self.s, (len(self.s),), EXTENT_MAX)
        check_floats("loads.force", self.force, (len(self.s), 3), 1e9)


class Start(Part, frozen=True):
    """Shape to start from: the frame of every segment, and the forces that held it."""

    s: np.ndarray  # (n,) m, arc length of every node, from 0 to the cable's length
    frames: np.ndarray  # (n-1, 4) quaternion of every segment
    grasp_forces: np.ndarray  # (g, 3) N, on the cable
    margin: float | None = None  # N, stability margin of that shape; with it a fold is announced before it is reached
    effects: tuple[str, ...] | None = None  # simulated in that shape: those that were on go off later than they come on

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.s)
        check_count("start", count, NODES_MAX)
        check_floats("start.s", self.s, (count,), EXTENT_MAX)
        check_quaternions("start.frames", self.frames, count - 1)
        check_floats("start.grasp_forces", self.grasp_forces, (len(self.grasp_forces), 3), 1e9)
        if count < 2 or not is_growing(self.s):
            raise MessageError("start.s: must grow strictly and have two nodes or more", key="start.s")


class Problem(Part, frozen=True):
    """One cable with its boundary conditions."""

    cable: Cable
    grasps: Grasps
    contacts: Contacts | None = None
    start: Start | None = None  # without it: a cold start
    loads: PointLoads | None = None
    model: Model = Model.AUTO
    turns: tuple[int, ...] = ()  # whole turns more than the least, from each clamp to the next; none unless given
    self_contacts: SelfContacts | None = None
    branch: int = 0  # on a cold start, 0: the shape found first; k: the k-th by energy of all stable shapes found, from 1
    effects: dict[str, bool] | None = None  # None: all that the numbers ask for; else by their size, but for those forced on or off here

    def __post_init__(self) -> None:
        """Check the cable, and what goes together."""
        check_cable(self.cable)
        check_effects(self.effects or {})
        length, s = self.cable.length, self.grasps.s
        if not len(s) or s[0] < 0 or s[-1] > length:
            raise MessageError(f"grasps.s: must have an entry or more, all from 0 to the cable's length, {length:g} m", key="grasps.s")
        if not (s[1:] - s[:-1] >= 1e-6 * length).all():
            raise MessageError(
                f"grasps.s: two grasps are closer than {1e-6 * length:g} m along the cable; hold it at two places", key="grasps.s"
            )
        if self.contacts is not None and len(self.contacts.s) and not 0 <= self.contacts.s.min() <= self.contacts.s.max() <= length:
            raise MessageError(f"contacts.s: must lie from 0 to the cable's length, {length:g} m", key="contacts.s")
        rubbing = self.contacts.rubbing if self.contacts is not None else None
        if rubbing is not None and len(rubbing.s) and not 0 <= rubbing.s.min() <= rubbing.s.max() <= length:
            raise MessageError(f"rubbing.s: must lie from 0 to the cable's length, {length:g} m", key="rubbing.s")
        touched = self.self_contacts
        if touched is not None and len(touched.s) and not 0 <= touched.s.min() <= touched.s.max() <= length:
            raise MessageError(f"self_contacts.s: must lie from 0 to the cable's length, {length:g} m", key="self_contacts.s")
        if all(hold is Hold.GUIDE for hold in self.grasps.hold):
            raise MessageError("grasps.hold: all are guides, along which the cable slides off; add a clamp or a hinge", key="grasps.hold")
        if self.loads is not None and len(self.loads.s) and not 0 <= self.loads.s.min() <= self.loads.s.max() <= length:
            raise MessageError(f"loads.s: must lie from 0 to the cable's length, {length:g} m", key="loads.s")
        clamps = sum(hold is not Hold.HINGE for hold in self.grasps.hold)
        if self.turns and len(self.turns) != clamps - 1:
            raise MessageError(
                f"turns: has {len(self.turns)} entries for {clamps} clamps; give one from each clamp to the next", key="turns"
            )
        if any(abs(turns) > TURNS_MAX for turns in self.turns):
            raise MessageError(f"turns: {list(self.turns)} must lie within {-TURNS_MAX} and {TURNS_MAX}", key="turns")
        if not 0 <= self.branch <= BRANCHES_MAX:
            raise MessageError(f"branch: {self.branch} must lie within 0 and {BRANCHES_MAX}", key="branch")
        if self.start is not None and len(self.start.grasp_forces) != len(s):
            raise MessageError(
                f"start.grasp_forces: has {len(self.start.grasp_forces)} rows for {len(s)} grasps; give one each", key="start.grasp_forces"
            )


class Cost(Part, frozen=True):
    """What an answer cost, in seconds of wall time by part."""

    solve: float  # equilibrium iterations, on all meshes
    estimate: float  # error estimate
    certify: float  # stability margin
    factorisations: int  # of the system of the finest mesh or of a coarser one, all counted
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
    contact_moments: np.ndarray  # (m, 3) N m, of the same about the axis at `contact_s`: on an edge the force acts beside the axis
    contact_s: np.ndarray  # (m,) m, where along the cable each contact has slid to
    outcome: Outcome
    sentence: str  # how it ended
    model: str  # "taut", "catenary", "gradient" or "rod"
    effects: tuple[str, ...]  # simulated
    left_out: dict[str, float]  # m, predicted size of the effects that are left out though the cable has them
    error: float | None  # m, estimated error of the node positions; None where the outcome is no shape
    error_tension: float | None  # N
    error_curvature: float | None  # 1/m
    residual: float  # N, largest unbalanced force
    iterations: int
    energy: float  # J, elastic and of the loads, which count from the world's origin
    total_twist: float  # rad, of the section about the tangent, from the first node to the last
    is_stable: bool  # certified from the inertia of the system, in three dimensions
    margin: float | None  # N, smallest stiffness against turning the segments, over their length; zero at a fold; None: not asked
    fold: float | None  # further steps like the last one until the shape snaps, predicted; None where no fold is in sight
    cost: Cost
    rubbed: Rubbed | None = None  # of the contacts that rub
    self_reactions: SelfReactions | None = None  # none without self-contacts in the request
    predicted: tuple[Predicted, ...] = ()  # of the effects that there was a choice about; none where none was asked for

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
            ("contact_moments", (contacts, 3), HUGE),
            ("contact_s", (contacts,), EXTENT_MAX),
        ):
            check_floats(f"shape.{name}", getattr(self, name), shape, most)
        check_quaternions("shape.frames", self.frames, segments)
        check_count("shape.predicted", len(self.predicted), len(CHOOSABLE))


class TouchPoints(Part, frozen=True):
    """Contacts that carry a force in a frame, one row each."""

    cable: np.ndarray  # (c,) int, index of the cable
    body: np.ndarray  # (c,) int, index into the snapshot's solids
    s: np.ndarray  # (c,) m, arc length on the cable
    point: np.ndarray  # (c, 3) m, on the body
    force: np.ndarray  # (c, 3) N, on the cable

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.s)
        check_floats("touching.s", self.s, (count,), EXTENT_MAX)
        check_floats("touching.point", self.point, (count, 3), EXTENT_MAX)
        check_floats("touching.force", self.force, (count, 3), HUGE)
        check_integers("touching.cable", self.cable, count, 0, GRASPS_MAX)
        check_integers("touching.body", self.body, count, -1, 10_000)
