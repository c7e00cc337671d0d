"""The messages, typed and checked on receipt. SI units, world frame, quaternions (x, y, z, w); see docs/protocol.md.

An array that reaches a program through a message has the dtype, the shape and the range that its field declares, so
nobody checks again. Every message checks itself when it is made, on either side of the wire.
"""

from __future__ import annotations

import msgspec
import numpy as np

from .checks import CONTACTS_MAX as CONTACTS_MAX
from .checks import EXTENT_MAX as EXTENT_MAX
from .checks import GRASPS_MAX as GRASPS_MAX
from .checks import HUGE as HUGE
from .checks import NODES_MAX as NODES_MAX
from .checks import check_count, check_floats, check_quaternions
from .crossings import CablePoints as CablePoints
from .crossings import CrossingReactions as CrossingReactions
from .crossings import Crossings as Crossings
from .crossings import check_crossings
from .effects import Audited as Audited
from .effects import Predicted as Predicted
from .errors import MessageError
from .parts import Contacts as Contacts
from .parts import Cost as Cost
from .parts import Grasps as Grasps
from .parts import Part as Part
from .parts import PointLoads as PointLoads
from .parts import Problem as Problem
from .parts import SelfContacts as SelfContacts
from .parts import SelfReactions as SelfReactions
from .parts import Shape as Shape
from .parts import Start as Start
from .parts import TouchPoints as TouchPoints
from .rubbing import FrictionLaw as FrictionLaw
from .rubbing import FrictionTable as FrictionTable
from .rubbing import Rubbed as Rubbed
from .rubbing import Rubbing as Rubbing
from .scene import Scene, Vector


class Message(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, kw_only=True):
    """Anything that crosses the wire on its own; the field `type` names it."""


class ShapeRequest(Message, frozen=True):
    """Boundary conditions of every cable; complete, so that the same request gives the same answer."""

    session: str
    step: int
    round: int
    gravity: Vector
    tolerance: float  # m
    problems: tuple[Problem, ...]
    budget: float | None = None  # s, for each cable: the best answer within that time, in place of the tolerance
    extrapolate: bool = True  # whether nodes may combine two meshes to fourth order; not for a shape that the next starts from
    margin: bool = False  # whether the stability margin is wanted too
    crossings: Crossings | None = None  # where cables touch each other, or one sticks to itself; every cable in it has a start

    def __post_init__(self) -> None:
        """Check ranges."""
        check_count("problems", len(self.problems), GRASPS_MAX)
        if self.step < 0 or self.round < 0:
            raise MessageError(f"step and round: {self.step} and {self.round} must be 0 or more", key="step")
        if not (0 < self.tolerance < EXTENT_MAX):
            raise MessageError(f"tolerance: {self.tolerance!r} m must be positive and finite", key="tolerance")
        if self.budget is not None and not (0 < self.budget < 1e6):
            raise MessageError(f"budget: {self.budget!r} s must be positive and finite", key="budget")
        if not all(abs(value) < 1e4 for value in self.gravity):
            raise MessageError(f"gravity: {list(self.gravity)} m/s^2 must be finite and below 1e4", key="gravity")
        if self.crossings is not None:
            check_crossings(self.crossings, tuple(problem.cable.length for problem in self.problems))


class ShapeReply(Message, frozen=True):
    """The shape of every cable of the request with the same session, step and round."""

    session: str
    step: int
    round: int
    shapes: tuple[Shape, ...]
    busy: float  # s, from receipt of the request to this reply, without encoding
    crossings: CrossingReactions | None = None  # none without crossings in the request, or without all shapes


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


class FrameRequest(Message, frozen=True):
    """Control to environment: send a frame again, out of its journal; `Finished` where the run ended before it."""

    sequence: int

    def __post_init__(self) -> None:
        """Check the range."""
        if not 0 <= self.sequence < 2**40:
            raise MessageError(f"sequence: {self.sequence} must be 0 or more, and below 2^40", key="sequence")


class Statistics(Message, frozen=True):
    """How far the run is."""

    step: int
    steps: int
    state: str  # "starting", "ready", "running", "paused", "finished" or "failed"
    sentence: str  # what it is doing
    silent: float = 0.0  # s since the shape server, while it is waited for, last gave a sign of life
    wants_audits: bool = False  # whether something is left out, so that there is work for a shape server that audits


class Solid(Part, frozen=True):
    """A rigid surface to draw: one body of the scene, or one link of the robot. Moves with its pose in each frame."""

    name: str
    vertices: np.ndarray  # (v, 3) m, in the solid's own frame
    triangles: np.ndarray  # (t, 3) int
    color: Vector  # red, green, blue from 0 to 1

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        check_floats(f"{self.name}.vertices", self.vertices, (len(self.vertices), 3), EXTENT_MAX)
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
    wait: float  # held by a pause, by viewers or by an audit
    total: float  # the whole step; less than the sum, for the robot moves while the shape server thinks


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
    relaxation: float = 0.0  # share of the time from one equilibrium to the next that has passed; 0 for an equilibrium
    crossing: CablePoints | None = None  # none in a scene whose cables pass through each other
    coupling: tuple[float, ...] = ()  # m, per cable: how far one more round would move it; none between two equilibria
    audits: tuple[Audited, ...] = ()  # of an earlier step, whose answer counts from here on

    def __post_init__(self) -> None:
        """Check shapes and ranges."""
        if not 0.0 <= self.relaxation < 1.0:
            raise MessageError(f"relaxation: {self.relaxation!r} must be 0 or more, and below 1", key="relaxation")
        check_floats("joints", self.joints, (len(self.joints),), EXTENT_MAX)
        check_floats("poses", self.poses, (len(self.poses), 7), EXTENT_MAX)
        check_quaternions("poses", np.ascontiguousarray(self.poses[:, 3:]), len(self.poses))
        if not all(0.0 <= value < HUGE for value in self.coupling):
            raise MessageError(f"coupling: {list(self.coupling)} must be 0 or more, and below {HUGE:g}", key="coupling")
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
    | FrameRequest
    | Statistics
    | Snapshot
    | Frame
    | Finished
)
