"""A light cable over half a cylinder, one end in a gripper and a load on the other: the capstan, stepped with the environment's own memory.

The cylinder is exact: its axis is an edge that the cable keeps a radius away from. Contacts, anchors and forces go from step to step
through `env_server.boundary`, as in the loop; only the search is replaced, by the nearest point of every segment to the axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np

import shape_server.kernels as compiled
from env_server.anchors import Laws
from env_server.boundary import Boundary
from env_server.touch import Candidates
from protocol.kinds import FRICTION_CODES, Feature, Friction, Hold, Outcome
from protocol.messages import FrictionLaw, Grasps, PointLoads, Problem, Shape, Start
from protocol.scene import Cable
from shape_server import solve
from shape_server.hard_cases.posing import frame

RADIUS = 0.0545  # m, of cylinder and cable together
LENGTH, SEGMENTS = 0.4, 48
LEG = 0.5 * (LENGTH - np.pi * RADIUS)  # m, hanging on either side
LOAD = 1.0  # N
STEP = 0.1  # s
REACH = 2e-3  # m
POSE = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
CABLE = Cable("cable", LENGTH, 0.009, 1e-6, 1e-5, 1e-5)
LIMP = Cable("cable", LENGTH, 0.009, 1e-6)
UP = frame((0.0, 0.0, 1.0), (0.0, 1.0, 0.0))


@dataclass(frozen=True)
class Drum:
    """The cable as the last step left it."""

    cable: Cable
    shape: Shape
    boundary: Boundary
    time: float

    @property
    def ratio(self) -> float:
        """Of the tension on the side of the gripper to that on the side of the load."""
        return float(self.shape.tension[0] / self.shape.tension[-1])

    @property
    def ratio_on_cylinder(self) -> float:
        """The same where the cable lies on, bent to the cylinder's curvature: T + kappa^2 EI / 2 does not change at a lift-off."""
        bent = 0.5 * (self.cable.bending or 0.0) / RADIUS**2
        return float((self.shape.tension[0] - bent) / (self.shape.tension[-1] - bent))

    @property
    def sticking(self) -> tuple[int, int]:
        """How many contacts that push stick, and how many there are."""
        assert self.shape.rubbed is not None
        return int(self.shape.rubbed.is_sticking.sum()), int(self.shape.contact_forces.any(axis=1).sum())

    def moved(self, lower: float, *, load: float = LOAD, pose: np.ndarray = POSE, rounds: int = 2) -> Drum:
        """After one more step, with the gripper lowered by so much [m] from where it began."""
        time, boundary, shape = self.time + STEP, self.boundary, self.shape
        for _ in range(rounds):
            contacts = boundary.contacts(_candidates(shape), shape.s, pose, time)
            forces = np.ascontiguousarray(shape.grasp_wrenches[:, :3])
            start = Start(s=shape.s, frames=shape.frames, grasp_forces=forces)
            loads = PointLoads(s=np.array([LENGTH]), force=np.array([[0.0, 0.0, -load]]))
            problem = Problem(cable=self.cable, grasps=_grasps(lower), contacts=contacts, start=start, loads=loads)
            shape = solve(problem, (0.0, 0.0, -9.81), extrapolate=False, path=compiled)
            assert shape.outcome is Outcome.CONVERGED, shape.sentence
            boundary = boundary.after(contacts, shape, pose)
        return Drum(self.cable, shape, boundary.anchored(contacts, shape, pose, time), time)


def begun(kind: Friction, law: FrictionLaw, segments: int = SEGMENTS, cable: Cable = CABLE) -> Drum:
    """The cable laid over the cylinder; its first shape is found without friction, as in a run."""
    s = np.linspace(0.0, LENGTH, segments + 1)
    angle = np.clip((0.5 * (s[1:] + s[:-1]) - LEG) / RADIUS, 0.0, np.pi)
    tangents = np.column_stack([np.sin(angle), np.zeros(segments), np.cos(angle)])
    nodes = np.vstack([np.zeros(3), np.cumsum(np.diff(s)[:, None] * tangents, axis=0)]) + _grasps(0.0).position[0]
    free = solve(Problem(cable=CABLE, grasps=_grasps(0.0)), (0.0, 0.0, -9.81), path=compiled)
    laid = msgspec.structs.replace(
        free,
        s=s,
        nodes=nodes,
        frames=np.array([frame(t, (0.0, 1.0, 0.0)) for t in tangents]),
        tension=np.full(segments, LOAD),
        curvature=np.zeros(segments + 1),
        grasp_wrenches=np.array([[0.0, 0.0, -LOAD, 0.0, 0.0, 0.0]]),
    )
    laws = Laws(np.array([FRICTION_CODES.index(kind)]), np.zeros(1, dtype=np.int64), (law,))
    boundary = Boundary(radius=RADIUS, length=LENGTH, bonding=np.zeros(1, dtype=bool), laws=laws)
    return Drum(cable, laid, boundary, 0.0).moved(0.0)


def settled(drum: Drum, lower: float, steps: int, *, stop: int | None = None, **changes: float) -> Drum:
    """With the gripper on its way to `lower` in so many steps of equal length, after all of them or as many as `stop`."""
    from_here = -(drum.shape.nodes[0, 2] + LEG)
    for step in range(1, (stop or steps) + 1):
        drum = drum.moved(from_here + (lower - from_here) * step / steps, **changes)
    return drum


def _grasps(lower: float) -> Grasps:
    return Grasps(s=np.zeros(1), position=np.array([[-RADIUS, 0.0, -LEG - lower]]), quaternion=UP[None, :], hold=(Hold.HINGE,))


def _candidates(shape: Shape) -> Candidates:
    """The nearest point of every segment to the cylinder's axis, if it is inside the segment and within reach."""
    first, steps = shape.nodes[:-1], np.diff(shape.nodes, axis=0)
    flat = np.array([1.0, 0.0, 1.0])
    fraction = -np.einsum("ij,ij->i", first * flat, steps) / np.einsum("ij,ij->i", steps * flat, steps)
    away = (first + fraction[:, None] * steps) * flat
    distance = np.linalg.norm(away, axis=1)
    segment = np.flatnonzero((fraction > 0.0) & (fraction < 1.0) & (distance < RADIUS + REACH))
    count = len(segment)
    return Candidates(
        segment=segment,
        fraction=fraction[segment],
        body=np.zeros(count, dtype=np.int64),
        feature=np.full(count, int(Feature.EDGE)),
        feature_id=np.zeros(count, dtype=np.int64),
        point=np.column_stack([np.zeros(count), (first + fraction[:, None] * steps)[segment, 1], np.zeros(count)]),
        normal=away[segment] / distance[segment, None],
        direction=np.tile([0.0, 1.0, 0.0], (count, 1)),
        extent=np.tile([-1.0, 1.0], (count, 1)),
        gap=distance[segment] - RADIUS,
        is_crossing=np.zeros(count, dtype=bool),
        is_beyond=np.zeros(count, dtype=bool),
        thickness=np.zeros(count),
        clearance=np.full(len(first), RADIUS),
    )


def turned(pose: np.ndarray, angle: float) -> np.ndarray:
    """The cylinder turned about its axis by an angle [rad]."""
    out = pose.copy()
    out[0, 3:] = [0.0, np.sin(0.5 * angle), 0.0, np.cos(0.5 * angle)]
    return out
