"""A small made-up run: two hands lower a hanging cable onto a block. No mechanics, only something to look at."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from protocol import recording
from protocol.codec import encode
from protocol.kinds import Hold, Outcome
from protocol.messages import Bill, Cost, Finished, Frame, Grasps, Shape, Snapshot, Solid, TouchPoints
from protocol.scene import Cable, Gripper, Scene

CABLE = Cable(name="harness", length=0.8, diameter=0.02, mass_per_length=0.1)
HANDS = tuple(
    Gripper(name=name, cable="harness", at=at, position=(0.5, y, 1.2), tangent=(0.0, 1.0, 0.0))
    for name, at, y in (("right", 0.0, -0.3), ("left", 0.8, 0.3))
)
SCENE = Scene(title="A made-up <run>", cables=(CABLE,), grippers=HANDS)
COST = Cost(solve=0.0, estimate=0.0, certify=0.0, factorisations=3, path="numpy")
BILL = Bill(**dict.fromkeys(Bill.__struct_fields__, 0.0))
CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
SIDES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)


def block(name: str, size: tuple[float, float, float], color: tuple[float, float, float] = (0.5, 0.5, 0.55)) -> Solid:
    return Solid(name=name, vertices=0.5 * np.array(size) * CORNERS, triangles=SIDES, color=color)


SNAPSHOT = Snapshot(
    session="run", scene=SCENE, solids=(block("table", (0.3, 0.8, 0.1)), block("hand", (0.04, 0.04, 0.1))), joints=(), steps=11, versions={}
)


def shape(height: float, *, count: int = 41) -> Shape:
    """A parabola that hangs by 0.15 m."""
    s = np.linspace(0.0, 0.8, count)
    y = np.linspace(-0.3, 0.3, count)
    nodes = np.stack([np.full(count, 0.5), y, height - 0.15 * (1 - (y / 0.3) ** 2)], axis=1)
    return Shape(
        s=s,
        nodes=nodes,
        frames=np.tile([0.0, 0.0, 0.0, 1.0], (count - 1, 1)),
        tension=np.full(count - 1, 1.25),
        curvature=np.zeros(count),
        grasp_wrenches=np.zeros((2, 6)),
        contact_forces=np.zeros((0, 3)),
        contact_moments=np.zeros((0, 3)),
        contact_s=np.zeros(0),
        outcome=Outcome.CONVERGED,
        sentence="",
        model="rod",
        effects=("gravity",),
        left_out={},
        error=1e-5,
        error_tension=None,
        error_curvature=None,
        residual=0.0,
        iterations=3,
        energy=0.0,
        total_twist=0.0,
        is_stable=True,
        margin=None,
        fold=None,
        cost=COST,
    )


def frame(sequence: int, *, picture: str = "", contacts: int = 1, session: str = "run") -> Frame:
    height = 1.2 - 0.01 * sequence
    place = np.array([0.5, 0.0, height - 0.15 - 0.01])
    return Frame(
        session=session,
        sequence=sequence,
        time=0.1 * sequence,
        move="lower" if sequence else "start",
        picture=picture,
        joints=np.zeros(0),
        poses=np.array([[0.5, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0], [0.5, 0.33, height + 0.05, 0.0, 0.0, 0.0, 1.0]]),
        grasps=(
            Grasps(
                s=np.array([0.0, 0.8]),
                position=np.array([[0.5, -0.3, height], [0.5, 0.3, height]]),
                quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)),
                hold=(Hold.CLAMP, Hold.CLAMP),
            ),
        ),
        shapes=(shape(height),),
        touching=TouchPoints(
            cable=np.zeros(contacts, np.int64),
            body=np.zeros(contacts, np.int64),
            s=np.full(contacts, 0.4),
            point=np.tile(place, (contacts, 1)),
            force=np.zeros((contacts, 3)),
        ),
        rounds=1,
        penetration=0.0,
        grasp_error=0.0,
        collisions=(),
        torque_ratio=0.0,
        bill=BILL,
    )


def frames(count: int = 11) -> list[Frame]:
    """A run whose first and last frame are key postures."""
    names = {0: "begin", count - 1: "laid / down"}
    return [frame(i, picture=names.get(i, "")) for i in range(count)]


FINISHED = Finished(session="run", frames=11, failed=False, sentence="done")


def write_run(folder: Path, *, finished: bool = True) -> Path:
    """A recording in `folder`; returns its path."""
    path = folder / recording.FILE_NAME
    with recording.Writer(path) as writer:
        for message in (SNAPSHOT, *frames(), *((FINISHED,) if finished else ())):
            writer.write(encode(message))
    return path
