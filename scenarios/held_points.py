"""Points of a cable that are held, and the frames that they are held in.

Roll. A tangent leaves open how the cable is turned about itself. The frame of the first grasp has its first director as
far up as it can be (along x where the tangent is vertical). Every next grasp has the frame before it, turned by the
smallest rotation that takes the one tangent to the other; for tangents that are opposite, in the plane of the tangent and the
chord. So a planar posture without `roll` is free of twist. `roll` then turns the frame about its tangent, right-handed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

from annotated_types import Ge

from protocol.kinds import Hold
from protocol.scene import STRICT, Metres, Quaternion, Unit, Vector

from . import frames

if TYPE_CHECKING:
    from protocol.messages import Grasps


@dataclass(frozen=True)
class HeldPoint:
    """A point of the cable that is held: its place, and its frame by a tangent and a roll, or by a quaternion."""

    __pydantic_config__: ClassVar = STRICT
    at: Annotated[float, Ge(0), Unit("m")]  # arc length
    position: Metres
    tangent: Vector | None = None  # direction of growing arc length
    roll: Annotated[float, Unit("rad")] = 0.0  # about the tangent
    quaternion: Quaternion | None = None  # of the cable's frame; d3 is the tangent
    hold: Hold = Hold.CLAMP


def grasps_of(points: tuple[HeldPoint, ...]) -> Grasps:
    """Held points, in any order and with tangent or quaternion each, as the grasps of a request."""
    import numpy as np

    from protocol.messages import Grasps

    ordered = sorted(points, key=lambda point: point.at)
    return Grasps(
        s=np.array([point.at for point in ordered]),
        position=np.array([point.position for point in ordered]),
        quaternion=np.array(_frames(ordered)),
        hold=tuple(point.hold for point in ordered),
    )


def _frames(points: list[HeldPoint]) -> list[Quaternion]:
    """Frames of held points in the order of growing arc length, by the rule at the top of this file."""
    found: list[Quaternion] = []
    frame: Quaternion | None = None  # of the point before, without its roll
    for index, point in enumerate(points):
        if point.tangent is None:
            assert point.quaternion is not None  # the posture has seen to it
            frame = frames.normal(point.quaternion)
            found.append(frame)
            continue
        if frame is None:
            frame = frames.upright(point.tangent)
        else:
            here, before = point.position, points[index - 1].position
            chord = (here[0] - before[0], here[1] - before[1], here[2] - before[2])
            frame = frames.carried(frame, point.tangent, chord)
        found.append(frames.multiply(frames.about(frames.unit(point.tangent), point.roll), frame))
    return found
