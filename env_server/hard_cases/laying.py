"""A cable that lies in the plane x-z, as a start; what it is held by; and floors."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from protocol.kinds import Friction, Hold, Primitive
from protocol.messages import Start
from protocol.scene import Body, Cable, Gripper, Move, Scene, Target, Vector

RADIUS: Final = 0.0045  # m
WEIGHT: Final = 0.981  # N, of a metre
LAWS: Final[dict[Friction, dict[str, Any]]] = {
    # Numbers of each kind of friction, for a coefficient of one.
    Friction.SIGNUM: {"friction_coefficient": 1.0},
    Friction.REGULARIZED: {"friction_coefficient": 1.0, "friction_speed": 1e-2},
    Friction.DEFINED: {"friction_table": ((0.0, 1.0), (1.0, 1.0))},
}


def cable(bending: float = 1e-3, **changes: Any) -> Cable:
    """A cable of a metre that weighs `WEIGHT`."""
    fields: dict[str, Any] = {"length": 1.0, "diameter": 2 * RADIUS, "mass_per_length": 0.1, "bending": bending, "twist": bending}
    return Cable(name="c", **{**fields, **changes})


def gripper(at: float, position: object, tangent: Vector = (1.0, 0.0, 0.0), *, name: str = "g", hold: Hold = Hold.CLAMP) -> Gripper:
    """A gripper in the plane x-z, which points along y so that its tangent may have any direction there."""
    x, y, z = (float(value) for value in np.asarray(position, dtype=float))
    return Gripper(name, "c", at, (x, y, z), tangent, approach=(0.0, 1.0, 0.0), hold=hold)


def rough(kind: Friction, mu: float) -> dict[str, Any]:
    """The fields of a body with friction of a kind and a coefficient."""
    if kind not in LAWS:
        return {"friction": kind}
    law = dict(LAWS[kind])
    if "friction_coefficient" in law:
        law["friction_coefficient"] = mu
    else:
        law["friction_table"] = tuple((speed, mu * share) for speed, share in law["friction_table"])
    return {"friction": kind, **law}


def plane(height: float = 0.0, *, tilt: float = 0.0, name: str = "floor", **fields: Any) -> Body:
    """A plane, solid below, that falls towards growing x by an angle `tilt` [rad]."""
    turn = (0.0, float(np.sin(0.5 * tilt)), 0.0, float(np.cos(0.5 * tilt)))
    return Body(name, shape=Primitive.PLANE, position=(0.0, 0.0, height), quaternion=turn, **fields)


def move(*targets: Target, seconds: float = 1.0, name: str = "move") -> Move:
    """One leg of the path."""
    return Move(name, seconds, targets)


def scene(held: Cable, grippers: tuple[Gripper, ...], bodies: tuple[Body, ...], moves: tuple[Move, ...], **fields: Any) -> Scene:
    """A scene of one cable."""
    given: dict[str, Any] = {"time_step": 0.1, "tolerance": 1e-2, **fields}
    return Scene("a hard case", (held,), grippers, moves, bodies, **given)


def lying(slopes: np.ndarray, s: np.ndarray, pull: object = (0.0, 0.0, 0.0)) -> Start:
    """A start whose segments have these slopes (n-1,) [rad] against x in the plane x-z, held at one point by a force `pull` [N]."""
    frames = Rotation.from_rotvec(np.outer(0.5 * np.pi - slopes, [0.0, 1.0, 0.0])).as_quat()
    return Start(s=s, frames=frames, grasp_forces=np.array(pull, dtype=float).reshape(-1, 3))


def straight(segments: int, slope: float = 0.0, length: float = 1.0, grasps: int = 1) -> Start:
    """A straight start."""
    return lying(np.full(segments, slope), np.linspace(0.0, length, segments + 1), np.zeros((grasps, 3)))
