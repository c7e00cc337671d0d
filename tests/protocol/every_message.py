"""One good message of every type, small and with every field filled in."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from protocol.kinds import Feature, Friction, Hold, Inclination, Outcome, SelfInteraction, SelfTouch
from protocol.messages import (
    AnyMessage,
    Audited,
    Beat,
    Bill,
    CablePoints,
    Contacts,
    Cost,
    CrossingReactions,
    Crossings,
    Done,
    Error,
    Finished,
    Frame,
    FrameRequest,
    FrictionLaw,
    FrictionTable,
    Grasps,
    Hello,
    Pause,
    PointLoads,
    Predicted,
    Problem,
    Resume,
    Rubbed,
    Rubbing,
    SelfContacts,
    SelfReactions,
    Shape,
    ShapeReply,
    ShapeRequest,
    Snapshot,
    SnapshotRequest,
    Solid,
    Start,
    StartRun,
    Statistics,
    StatisticsRequest,
    Stop,
    TouchPoints,
    Welcome,
)
from protocol.scene import Arm, Body, Cable, Gripper, LumpedMass, Move, Picture, Robot, Scene, Section, Target

Path = tuple[str | int, ...]

CABLE = Cable(
    name="trunk",
    length=1.2,
    diameter=0.009,
    mass_per_length=0.09,
    bending=0.02,
    twist=0.0164,
    bending_2=0.03,
    stretch=1e4,
    natural_curvature=(0.1, 0.2, 0.3),
    micro_length=0.01,
    bend_radius=0.05,
    self_interaction=SelfInteraction.FICTITIOUS,
    sections=(Section(start=0.1, end=0.4, bending=0.05), Section(start=0.4, end=1.2, mass_per_length=0.2)),
    masses=(LumpedMass(at=0.6, mass=0.01),),
)


REACTIONS = CrossingReactions(
    s=np.array([[0.3, 0.9]]),
    force=np.array([[0.0, 0, 2]]),
    point=np.ones((1, 3)),
    gap=np.zeros(1),
    drag=np.array([[0.1, 0, 0]]),
    lag=np.zeros((1, 3)),
    is_sticking=np.ones(1, np.int64),
)


def quaternions(count: int) -> np.ndarray:
    """Unit quaternions, each another."""
    angles = np.linspace(0.0, 1.0, count)
    return np.stack([np.sin(angles), np.zeros(count), np.zeros(count), np.cos(angles)], axis=1)


def grasps() -> Grasps:
    return Grasps(
        s=np.array([0.0, 1.2]), position=np.array([[0.0, 0, 1], [1, 0, 1]]), quaternion=quaternions(2), hold=(Hold.CLAMP, Hold.HINGE)
    )


def contacts() -> Contacts:
    """A face, an edge and a vertex."""
    return Contacts(
        s=np.array([0.3, 0.6, 0.9]),
        body=np.array([0, 1, -1]),
        feature=np.array([Feature.FACE, Feature.EDGE, Feature.VERTEX]),
        point=np.full((3, 3), 0.5),
        normal=np.array([[0.0, 0, 1]] * 3),
        direction=np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0]]),
        extent=np.array([[0.0, 0], [0.1, 0.2], [0, 0]]),
        distance=np.full(3, 0.0045),
        friction=np.array([0, 1, 4]),
        force=np.zeros((3, 3)),
        rubbing=rubbing(),
        inclination=np.array([0, 1, 0]),
    )


def self_contacts() -> SelfContacts:
    """One place where the cable meets itself."""
    return SelfContacts(
        s=np.array([[0.3, 0.9]]),
        kind=np.array([SelfTouch.CONTACT]),
        normal=np.array([[0.0, 0, 1]]),
        distance=np.full(1, 0.009),
        force=np.array([[0.0, 0, 2]]),
    )


def rubbing() -> Rubbing:
    """Of the vertex, with a table."""
    table = FrictionTable(speeds=np.array([0.0, 0.1]), normals=np.array([1.0, 2.0]), forces=np.array([[0.4, 0.7], [0.3, 0.6]]))
    law = FrictionLaw(coefficient=0.3, speed=0.01, table=table)
    return Rubbing(contact=np.array([2]), law=np.array([0]), s=np.array([0.9]), anchor=np.full((1, 3), 0.5), laws=(law,), time_step=0.02)


def start() -> Start:
    return Start(s=np.linspace(0.0, 1.2, 4), frames=quaternions(3), grasp_forces=np.ones((2, 3)), margin=0.4, effects=("gravity",))


def shape() -> Shape:
    return Shape(
        s=np.linspace(0.0, 1.2, 4),
        nodes=np.arange(12.0).reshape(4, 3),
        frames=quaternions(3),
        tension=np.ones(3),
        curvature=np.ones(4),
        grasp_wrenches=np.ones((2, 6)),
        contact_forces=np.ones((3, 3)),
        contact_moments=np.ones((3, 3)),
        contact_s=np.array([0.3, 0.6, 0.9]),
        outcome=Outcome.CONVERGED,
        sentence="converged",
        model="rod",
        effects=("gravity", "bending"),
        left_out={"stretch": 1e-6},
        error=1e-4,
        error_tension=1e-3,
        error_curvature=1e-2,
        residual=1e-9,
        iterations=2,
        energy=-0.5,
        total_twist=0.1,
        is_stable=True,
        margin=0.3,
        fold=2.5,
        self_reactions=SelfReactions(s=np.array([[0.3, 0.9]]), force=np.array([[0.0, 0, 2]]), gap=np.zeros(1)),
        cost=Cost(solve=1e-3, estimate=1e-4, certify=1e-5, factorisations=4, path="numba"),
        rubbed=Rubbed(s=np.array([0.9]), anchor=np.full((1, 3), 0.5), is_sticking=np.array([1])),
        predicted=(Predicted(name="stretch", size=1e-6, force=1e-3, curvature=1e-2, is_on=False, why="below"),),
    )


def scene() -> Scene:
    return Scene(
        title="a scene",
        cables=(CABLE,),
        grippers=(Gripper(name="left", cable="trunk", at=0.0, position=(0.0, 0.0, 1.0), tangent=(1.0, 0.0, 0.0), arm="left"),),
        moves=(Move(name="down", duration=1.0, targets=(Target(gripper="left", by=(0.0, 0.0, -0.1)),)),),
        bodies=(
            Body(name="dashboard", generate="dashboard", friction=Friction.BOND, inclination=Inclination.FIXED),
            Body(name="beam", generate="beam", friction=Friction.REGULARIZED, friction_coefficient=0.3, friction_speed=0.01),
            Body(name="wall", mesh="wall.stl", friction=Friction.DEFINED, friction_table=((0.0, 0.3, 0.5),), friction_normals=(1.0, 2.0)),
        ),
        robot=Robot(arms=(Arm(name="left", tip="hand", hand=("finger",)),)),
        pictures=(Picture(name="1", after="down"),),
        effects={"gravity": True},
    )


def crossings() -> Crossings:
    """Two places of one cable that stick."""
    return Crossings(
        cable=np.zeros((1, 2), np.int64),
        s=np.array([[0.3, 0.9]]),
        kind=np.array([SelfTouch.BOND]),
        normal=np.array([[0.0, 0, 1]]),
        distance=np.full(1, 0.009),
        force=np.array([[0.0, 0, 2]]),
        arm=np.full((1, 6), 1e-3),
        mu=np.zeros(1),
        held=np.zeros((1, 2)),
        drag=np.zeros((1, 3)),
    )


def solid() -> Solid:
    return Solid(name="box", vertices=np.eye(3), triangles=np.array([[0, 1, 2]]), color=(0.5, 0.5, 0.5))


def frame() -> Frame:
    return Frame(
        session="session",
        sequence=7,
        time=0.14,
        move="down",
        picture="",
        joints=np.zeros(2),
        poses=np.array([[0.0, 0, 0, 0, 0, 0, 1]]),
        grasps=(grasps(),),
        shapes=(shape(),),
        touching=TouchPoints(
            cable=np.zeros(1, np.int64), body=np.zeros(1, np.int64), s=np.array([0.3]), point=np.ones((1, 3)), force=np.ones((1, 3))
        ),
        rounds=2,
        penetration=0.0,
        grasp_error=1e-9,
        collisions=(("left_hand", "dashboard"),),
        torque_ratio=0.1,
        bill=Bill(solve=1e-3, search=1e-3, robot=1e-3, encode=1e-3, wire=1e-3, wait=0.0, total=5e-3),
        coupling=(1e-6,),
        crossing=CablePoints(cable=np.array([[0, 0]]), s=np.array([[0.3, 0.9]]), point=np.ones((1, 3)), force=np.ones((1, 3))),
        audits=(Audited(step=2, cable=0, name="stretch", bound=1e-5, actual=2e-5, is_broken=True, is_switched_on=True),),
    )


def request() -> ShapeRequest:
    loads = PointLoads(s=np.array([0.6]), force=np.ones((1, 3)))
    problem = Problem(
        cable=CABLE,
        grasps=grasps(),
        contacts=contacts(),
        self_contacts=self_contacts(),
        start=start(),
        loads=loads,
        effects={"stretch": True},
    )
    return ShapeRequest(
        session="session", step=7, round=1, gravity=(0.0, 0.0, -9.81), tolerance=1e-3, problems=(problem,), crossings=crossings()
    )


def every_message() -> list[AnyMessage]:
    """One of each type that may cross the wire on its own."""
    return [
        request(),
        ShapeReply(session="session", step=7, round=1, shapes=(shape(),), busy=1e-3, crossings=REACTIONS),
        Beat(session="session", step=7, round=1, iterations=40, residual=0.5),
        Hello(version=3, role="env_server"),
        Welcome(version=1, role="shape_server", kernels="compiled"),
        Error(code="message", sentence="not a message", key="problems"),
        StartRun(recorders=2),
        Pause(),
        Resume(),
        Stop(),
        Done(),
        SnapshotRequest(),
        StatisticsRequest(),
        FrameRequest(sequence=7),
        Statistics(step=3, steps=60, state="running", sentence="running", wants_audits=True),
        Snapshot(session="session", scene=scene(), solids=(solid(),), joints=("a", "b"), steps=60, versions={"python": "3.13"}),
        frame(),
        Finished(session="session", frames=61, failed=False, sentence="finished"),
    ]


def places(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Every value inside a plain message, with the keys and indices that lead to it."""
    yield path, value
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from places(item, (*path, key))


def at(value: Any, path: Path) -> Any:
    """What is found there."""
    for key in path:
        value = value[key]
    return value


def replaced(value: Any, path: Path, new: Any) -> Any:
    """A copy with another value there."""
    if not path:
        return new
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = replaced(value[path[0]], path[1:], new) if path[1:] else new
    return copy
