"""Frames with chosen figures, and recordings made of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from protocol import recording
from protocol.codec import encode
from protocol.kinds import Hold, Outcome
from protocol.messages import Bill, Cost, Finished, Frame, Grasps, Shape, Snapshot, TouchPoints
from protocol.scene import Cable, Gripper, Scene

SCENE = Scene(
    title="a scene [0] of a test",
    cables=(Cable(name="wire", length=1.0, diameter=0.006, mass_per_length=0.02),),
    grippers=(Gripper(name="hand", cable="wire", at=0.0, position=(0.0, 0.0, 0.0), tangent=(1.0, 0.0, 0.0)),),
)
COST = Cost(solve=0.0, estimate=0.0, certify=0.0, factorisations=1, path="numpy")


def shape(*, outcome: Outcome = Outcome.CONVERGED, tension: float = 1.0, curvature: float = 2.0, force: float = 3.0) -> Shape:
    return Shape(
        s=np.array([0.0, 1.0]),
        nodes=np.zeros((2, 3)),
        frames=np.array([[0.0, 0.0, 0.0, 1.0]]),
        tension=np.array([tension]),
        curvature=np.array([0.0, -curvature]),
        grasp_wrenches=np.array([[0.0, force, 0.0, 9.0, 9.0, 9.0]]),
        contact_forces=np.zeros((0, 3)),
        contact_moments=np.zeros((0, 3)),
        contact_s=np.zeros(0),
        outcome=outcome,
        sentence="as wished",
        model="rod",
        effects=("gravity",),
        left_out={"stretch": 1e-6},
        error=1e-4,
        error_tension=1e-3,
        error_curvature=None,
        residual=0.0,
        iterations=1,
        energy=-0.1,
        total_twist=0.0,
        is_stable=True,
        margin=None,
        fold=None,
        cost=COST,
    )


def frame(sequence: int, *, shapes: tuple[Shape, ...] | None = None, contacts: int = 0, seconds: float = 0.001, **others: object) -> Frame:
    grasps = Grasps(s=np.zeros(1), position=np.zeros((1, 3)), quaternion=np.array([[0.0, 0.0, 0.0, 1.0]]), hold=(Hold.CLAMP,))
    touching = TouchPoints(
        cable=np.zeros(contacts, np.int64),
        body=np.zeros(contacts, np.int64),
        s=np.zeros(contacts),
        point=np.zeros((contacts, 3)),
        force=np.zeros((contacts, 3)),
    )
    values: dict[str, object] = {"rounds": 1, "penetration": 0.0, "grasp_error": 0.0, "collisions": (), "torque_ratio": 0.1}
    return Frame(
        session="test",
        sequence=sequence,
        time=0.02 * sequence,
        move="start",
        picture="",
        joints=np.zeros(0),
        poses=np.zeros((0, 7)),
        grasps=(grasps,),
        shapes=shapes or (shape(),),
        touching=touching,
        bill=Bill(**{name: seconds if name in ("solve", "total") else 0.0 for name in Bill.__struct_fields__}),
        **(values | others),  # type: ignore[arg-type]
    )


def snapshot(steps: int) -> Snapshot:
    return Snapshot(session="test", scene=SCENE, solids=(), joints=(), steps=steps, versions={"python": "3"})


def record(path: Path, frames: list[Frame], *, steps: int = 3, finished: Finished | None = None) -> recording.Recording:
    with recording.Writer(path) as writer:
        for message in (snapshot(steps), *frames, *([] if finished is None else [finished])):
            writer.write(encode(message))
    return recording.read(path)
