"""The messages, typed and checked on receipt. SI units, world frame, quaternions (x, y, z, w); see docs/protocol.md.

An array that reaches a program through a message has the dtype, the shape and the range that its field declares, so
nobody checks again. Every message checks itself when it is made, on either side of the wire.
"""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from .errors import MessageError
from .kinds import FRICTION_CODES, Feature, Hold, Outcome
from .scene import LENGTH_MAX, MASS_MAX, STIFFNESS_MAX, Cable, Scene, Vector

NODES_MAX: Final = 20_000
CONTACTS_MAX: Final = 5_000
GRASPS_MAX: Final = 100
HUGE: Final = 1e12  # in any unit; a number beyond this is a mistake
EXTENT_MAX: Final = 1e4  # m; a coordinate beyond this is a mistake, not a scene


class Message(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Anything that crosses the wire on its own; the field `type` names it."""


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
        _check_count("grasps", count, GRASPS_MAX)
        _check_floats("grasps.s", self.s, (count,), EXTENT_MAX)
        _check_floats("grasps.position", self.position, (count, 3), EXTENT_MAX)
        _check_quaternions("grasps.quaternion", self.quaternion, count)
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
        _check_count("contacts", count, CONTACTS_MAX)
        for name, low, high in (("body", -1, 10_000), ("feature", 0, len(Feature) - 1), ("friction", 0, len(FRICTION_CODES) - 1)):
            _check_integers(f"contacts.{name}", getattr(self, name), count, low, high)
        for name in ("s", "distance"):
            _check_floats(f"contacts.{name}", getattr(self, name), (count,), EXTENT_MAX)
        for name in ("point", "normal", "direction"):
            _check_floats(f"contacts.{name}", getattr(self, name), (count, 3), EXTENT_MAX)
        _check_floats("contacts.extent", self.extent, (count, 2), EXTENT_MAX)
        _check_floats("contacts.force", self.force, (count, 3), 1e9)
        _check_units("contacts.normal", self.normal)
        _check_units("contacts.direction", self.direction[self.feature == Feature.EDGE])


class Start(Part, frozen=True):
    """Shape to start from: the frame of every segment, and the forces that held it."""

    s: np.ndarray  # (n,) m, arc length of every node, from 0 to the cable's length
    frames: np.ndarray  # (n-1, 4) quaternion of every segment
    grasp_forces: np.ndarray  # (g, 3) N, on the cable

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        count = len(self.s)
        _check_count("start", count, NODES_MAX)
        _check_floats("start.s", self.s, (count,), EXTENT_MAX)
        _check_quaternions("start.frames", self.frames, count - 1)
        _check_floats("start.grasp_forces", self.grasp_forces, (len(self.grasp_forces), 3), 1e9)
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
        _check_cable(self.cable)
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
        _check_count("shape", nodes, NODES_MAX)
        for name, shape, most in (
            ("s", (nodes,), EXTENT_MAX),
            ("nodes", (nodes, 3), EXTENT_MAX),
            ("tension", (segments,), HUGE),
            ("curvature", (nodes,), HUGE),
            ("grasp_wrenches", (grasps, 6), HUGE),
            ("contact_forces", (contacts, 3), HUGE),
            ("contact_s", (contacts,), EXTENT_MAX),
        ):
            _check_floats(f"shape.{name}", getattr(self, name), shape, most)
        _check_quaternions("shape.frames", self.frames, segments)


class ShapeRequest(Message, frozen=True):
    """Boundary conditions of every cable; complete, so that the same request gives the same answer."""

    session: str
    step: int
    round: int
    gravity: Vector
    tolerance: float  # m
    problems: tuple[Problem, ...]

    def __post_init__(self) -> None:
        """Check ranges."""
        _check_count("problems", len(self.problems), GRASPS_MAX)
        if self.step < 0 or self.round < 0:
            raise MessageError(f"step and round: {self.step} and {self.round} must be 0 or more", key="step")
        if not (0 < self.tolerance < EXTENT_MAX):
            raise MessageError(f"tolerance: {self.tolerance!r} m must be positive and finite", key="tolerance")
        if not all(abs(value) < 1e4 for value in self.gravity):
            raise MessageError(f"gravity: {list(self.gravity)} m/s^2 must be finite and below 1e4", key="gravity")


class ShapeReply(Message, frozen=True):
    """The shape of every cable of the request with the same session, step and round."""

    session: str
    step: int
    round: int
    shapes: tuple[Shape, ...]
    busy: float  # s, from receipt of the request to this reply, without encoding


class Beat(Message, frozen=True):
    """Proof of life during a long solve."""

    session: str
    step: int
    round: int
    iterations: int
    residual: float  # N


class Hello(Message, frozen=True):
    """First message of every peer."""

    version: int
    role: str
    project: str = "cablecosim"


class Welcome(Message, frozen=True):
    """Answer to `Hello` from a peer of the same version."""

    version: int
    role: str
    project: str = "cablecosim"
    nodes_max: int = NODES_MAX
    contacts_max: int = CONTACTS_MAX
    kernels: str = ""  # shape server: "compiled", "compiling" or "numpy"
    scene_hash: str = ""  # environment: hash of the scene


class Error(Message, frozen=True):
    """A request that was not carried out; nothing was changed by it."""

    code: str  # "message", "version", "scene", "state" or "not_built"
    sentence: str
    key: str = ""


class StartRun(Message, frozen=True):
    """Control to environment: begin to step once so many recorders have joined."""

    recorders: int = 0

    def __post_init__(self) -> None:
        """Check the range."""
        if not 0 <= self.recorders <= GRASPS_MAX:
            raise MessageError(f"recorders: {self.recorders} must lie within 0 and {GRASPS_MAX}", key="recorders")


class Pause(Message, frozen=True):
    """Control to environment: hold before the next step."""


class Resume(Message, frozen=True):
    """Control to environment: go on after a pause."""


class Stop(Message, frozen=True):
    """Control to any program: end in good order."""


class Done(Message, frozen=True):
    """Answer to a control message that was carried out."""


class SnapshotRequest(Message, frozen=True):
    """Control to environment: what does the scene look like?"""


class StatisticsRequest(Message, frozen=True):
    """Control to environment: how far is the run?"""


class Statistics(Message, frozen=True):
    """How far the run is."""

    step: int
    steps: int
    state: str  # "starting", "ready", "running", "paused", "finished" or "failed"
    sentence: str  # what it is doing


class Solid(Part, frozen=True):
    """A rigid surface to draw: one body of the scene, or one link of the robot. Moves with its pose in each frame."""

    name: str
    vertices: np.ndarray  # (v, 3) m, in the solid's own frame
    triangles: np.ndarray  # (t, 3) int
    color: Vector  # red, green, blue from 0 to 1

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        _check_floats(f"{self.name}.vertices", self.vertices, (len(self.vertices), 3), EXTENT_MAX)
        if self.triangles.dtype != np.int64 or self.triangles.ndim != 2 or self.triangles.shape[1] != 3:
            raise MessageError(f"{self.name}.triangles: must be (t, 3) of <i8", key=self.name)
        if self.triangles.size and not 0 <= self.triangles.min() <= self.triangles.max() < len(self.vertices):
            raise MessageError(f"{self.name}.triangles: names a vertex that does not exist", key=self.name)


class Snapshot(Message, frozen=True):
    """All that does not change during a run; the first entry of every recording."""

    session: str
    scene: Scene
    solids: tuple[Solid, ...]  # in the order of `Frame.poses`
    joints: tuple[str, ...]  # names, in the order of `Frame.joints`
    steps: int  # time steps of the whole run
    versions: dict[str, str]  # of the programs and libraries that made it


class Bill(Part, frozen=True):
    """Where the time of one step went, in seconds of wall time."""

    solve: float  # predicting the shape, in shape_server
    search: float  # finding where the cable touches, and deciding what to ask about
    robot: float  # inverse kinematics, moving the scene, collisions of the robot
    encode: float  # messages to bytes and back, in env_server, the last frame among them
    wire: float  # between the two programs: round trip less what the shape server was busy
    wait: float  # held by a pause or by viewers
    total: float  # the whole step; less than the sum, for the robot moves while the shape server thinks


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
        _check_floats("touching.s", self.s, (count,), EXTENT_MAX)
        _check_floats("touching.point", self.point, (count, 3), EXTENT_MAX)
        _check_floats("touching.force", self.force, (count, 3), HUGE)
        _check_integers("touching.cable", self.cable, count, 0, GRASPS_MAX)
        _check_integers("touching.body", self.body, count, -1, 10_000)


class Frame(Message, frozen=True):
    """One time step as it ended: for looking and for the record."""

    session: str
    sequence: int  # counts from 0 without gaps
    time: float  # s, simulated
    move: str  # name of the move under way; "start" for the first frame
    picture: str  # name of the key posture to be stored here; empty otherwise
    joints: np.ndarray  # (j,) rad or m
    poses: np.ndarray  # (b, 7) position and quaternion of every solid of the snapshot
    grasps: tuple[Grasps, ...]  # per cable
    shapes: tuple[Shape, ...]  # per cable
    touching: TouchPoints
    rounds: int  # of boundary conditions re-evaluated
    penetration: float  # m, deepest of the cable into any body; 0 if none
    grasp_error: float  # m, largest distance between a held point of the cable and its gripper's goal
    collisions: tuple[tuple[str, str], ...]  # pairs of links or bodies of the robot and scene that touch
    torque_ratio: float  # largest static joint torque over its limit; 0 without a robot
    bill: Bill

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        _check_floats("joints", self.joints, (len(self.joints),), EXTENT_MAX)
        _check_floats("poses", self.poses, (len(self.poses), 7), EXTENT_MAX)
        _check_quaternions("poses", np.ascontiguousarray(self.poses[:, 3:]), len(self.poses))
        for name in ("time", "penetration", "grasp_error", "torque_ratio"):
            if not abs(getattr(self, name)) < HUGE:
                raise MessageError(f"{name}: {getattr(self, name)!r} must be finite, and below {HUGE:g}", key=name)


class Finished(Message, frozen=True):
    """Last message of the streams: the run ended, well or with a sentence."""

    session: str
    frames: int
    failed: bool
    sentence: str


AnyMessage = (
    ShapeRequest
    | ShapeReply
    | Beat
    | Hello
    | Welcome
    | Error
    | StartRun
    | Pause
    | Resume
    | Stop
    | Done
    | SnapshotRequest
    | StatisticsRequest
    | Statistics
    | Snapshot
    | Frame
    | Finished
)


def _check_cable(cable: Cable) -> None:
    """Check the numbers of a cable that came over the wire."""
    for name, value, most, unit in (
        ("length", cable.length, LENGTH_MAX, "m"),
        ("diameter", cable.diameter, LENGTH_MAX, "m"),
        ("bending", cable.bending, STIFFNESS_MAX, "N m^2"),
        ("twist", cable.twist, STIFFNESS_MAX, "N m^2"),
        ("mass_per_length", cable.mass_per_length, MASS_MAX, "kg/m"),
    ):
        is_mass = name == "mass_per_length"
        if value is not None and not ((value >= 0.0 if is_mass else value > 0.0) and value <= most):
            sentence = f"cable.{name}: {value!r} must be {'0 or more' if is_mass else 'positive'}, and at most {most:g} {unit}"
            raise MessageError(sentence, key=f"cable.{name}")
    if (cable.bending is None) != (cable.twist is None):
        raise MessageError("cable: has both 'bending' (EI) and 'twist' (GJ), or neither (a catenary)", key="cable")


def _check_count(key: str, count: int, most: int) -> None:
    if count > most:
        raise MessageError(f"{key}: {count} entries are too many; at most {most}", key=key)


def _check_floats(key: str, array: np.ndarray, shape: tuple[int, ...], most: float) -> None:
    if array.dtype != np.float64 or array.shape != shape:
        raise MessageError(f"{key}: {array.dtype.str} of shape {array.shape} must be <f8 of shape {shape}", key=key)
    # A comparison with NaN is false, so this one test covers NaN and infinity as well.
    if array.size and not max(array.max(), -array.min()) < most:
        raise MessageError(f"{key}: holds a value that is not finite, or not below {most:g}", key=key)


def _check_units(key: str, array: np.ndarray) -> None:
    if len(array) and np.abs(np.einsum("ij,ij->i", array, array) - 1.0).max() > 1e-6:
        raise MessageError(f"{key}: every vector must have length 1 to within 5e-7", key=key)


def _check_integers(key: str, array: np.ndarray, count: int, low: int, high: int) -> None:
    if array.dtype != np.int64 or array.shape != (count,):
        raise MessageError(f"{key}: {array.dtype.str} of shape {array.shape} must be <i8 of shape ({count},)", key=key)
    if count and not low <= array.min() <= array.max() <= high:
        raise MessageError(f"{key}: values must lie within {low} and {high}", key=key)


def _check_quaternions(key: str, array: np.ndarray, count: int) -> None:
    _check_floats(key, array, (count, 4), 2.0)
    if count and np.abs(np.einsum("ij,ij->i", array, array) - 1.0).max() > 1e-6:
        raise MessageError(f"{key}: every quaternion must have length 1 to within 5e-7", key=key)
