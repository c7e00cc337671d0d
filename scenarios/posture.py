"""One static posture: a cable, where it is held, and what it touches; the quickest way to ask what shape a cable takes.

    title = "a wire between two clamps"
    cable = {name = "wire", length = 1.0, diameter = 0.006, mass_per_length = 0.0174, bending = 1.2e-4, twist = 1.0e-4}
    grasps = [{at = 0, position = [0, 0, 0], tangent = [1, 0, 0]}, {at = 1, position = [0.6, 0, 0], tangent = [1, 0, 0]}]

Roll. A tangent leaves open how the cable is turned about itself. The frame of the first grasp has its first director as
far up as it can be (along x where the tangent is vertical). Every next grasp has the frame before it, turned by the
smallest rotation that takes the one tangent to the other; for tangents that are opposite, in the plane of the tangent and the
chord. So a planar posture without `roll` is free of twist. `roll` then turns the frame about its tangent, right-handed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from annotated_types import Ge, Le, MinLen

from protocol.kinds import FRICTION_CODES, Feature, Friction, Hold
from protocol.scene import STRICT, Cable, Metres, Positive, Quaternion, Unit, Vector

from . import frames
from .document import Document, read_text
from .quantity import Mistake

if TYPE_CHECKING:
    from protocol.messages import Contacts, Grasps, ShapeRequest


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


@dataclass(frozen=True)
class PointContact:
    """A plane, through a point and square to a normal, that one place of the cable may touch but not pass.

    The rest of the cable does not know of it: where it passes through as well, give another contact there.
    """

    __pydantic_config__: ClassVar = STRICT
    at: Annotated[float, Ge(0), Unit("m")]  # arc length where the cable is expected to touch
    point: Metres
    normal: Vector  # towards the cable
    friction: Friction = Friction.NONE
    distance: Annotated[Positive, Unit("m")] | None = None  # of the cable's axis when it touches; the radius unless given


@dataclass(frozen=True)
class Posture:
    """Everything that one static shape depends on."""

    __pydantic_config__: ClassVar = STRICT
    title: Annotated[str, MinLen(1)]
    cable: Cable
    grasps: Annotated[tuple[HeldPoint, ...], MinLen(1)]
    contacts: tuple[PointContact, ...] = ()
    gravity: Annotated[Vector, Unit("m/s^2")] = (0.0, 0.0, -9.81)
    tolerance: Annotated[Positive, Le(1e3), Unit("m")] = 1e-3

    def request(self) -> ShapeRequest:
        """The question to the shape server; its grasps are in the order of growing arc length."""
        from protocol.messages import Problem, ShapeRequest

        problem = Problem(cable=self.cable, grasps=_grasps(self.grasps), contacts=_contacts(self.contacts, 0.5 * self.cable.diameter))
        return ShapeRequest(session="posture", step=0, round=0, gravity=self.gravity, tolerance=self.tolerance, problems=(problem,))


def load_posture(path: str | Path, overrides: Sequence[str] = ()) -> Posture:
    """The posture in a TOML file, checked.

    Raises:
        SceneError: Holds one sentence for every mistake, each on a line of its own.
    """
    return Document(str(path), read_text(Path(path)), overrides).read(Posture, _mistakes)


def _mistakes(posture: Posture) -> Iterator[Mistake]:
    cable = posture.cable
    if cable.diameter >= cable.length:
        text = f"{cable.diameter:g} m must be smaller than the cable's length, {cable.length:g} m"
        yield Mistake(("cable", "diameter"), text)
    if (cable.bending is None) != (cable.twist is None):
        missing = "twist" if cable.twist is None else "bending"
        yield Mistake(("cable", missing), "missing; a cable has both 'bending' (EI) and 'twist' (GJ), or neither (a catenary)")
    for index, grasp in enumerate(posture.grasps):
        yield from _beyond(("grasps", index, "at"), grasp.at, cable)
        if (grasp.tangent is None) == (grasp.quaternion is None):
            yield Mistake(("grasps", index), "needs either 'tangent' or 'quaternion', one of the two")
        if grasp.quaternion is not None and grasp.roll:
            yield Mistake(("grasps", index, "roll"), f"{grasp.roll:g} rad goes with 'tangent'; the quaternion holds the roll already")
        for name in ("tangent", "quaternion"):
            yield from _no_direction(("grasps", index, name), getattr(grasp, name))
    for index, contact in enumerate(posture.contacts):
        yield from _beyond(("contacts", index, "at"), contact.at, cable)
        yield from _no_direction(("contacts", index, "normal"), contact.normal)
    yield from _too_far_apart(posture)


def _too_far_apart(posture: Posture) -> Iterator[Mistake]:
    held = sorted(range(len(posture.grasps)), key=lambda index: posture.grasps[index].at)
    for first, second in pairwise(held):
        one, two = posture.grasps[first], posture.grasps[second]
        span, chord = two.at - one.at, math.dist(one.position, two.position)
        if span < 1e-6 * posture.cable.length:
            text = f"{two.at:g} m is where grasps[{first}] holds the cable already; hold it at two places"
            yield Mistake(("grasps", second, "at"), text)
        elif chord > span:
            text = f"is {chord:.4g} m from grasps[{first}], with {span:.4g} m of cable between them; bring it within {span:.4g} m"
            yield Mistake(("grasps", second, "position"), text)


def _beyond(path: tuple[str | int, ...], at: float, cable: Cable) -> Iterator[Mistake]:
    if at > cable.length:
        yield Mistake(path, f"{at:g} m lies beyond the end of the cable; give 0 to {cable.length:g} m")


def _no_direction(path: tuple[str | int, ...], vector: tuple[float, ...] | None) -> Iterator[Mistake]:
    if vector is not None and not 1e-9 < math.hypot(*vector) < math.inf:
        yield Mistake(path, f"{list(vector)} has no direction; give numbers that are not all zero")


def _contacts(points: tuple[PointContact, ...], radius: float) -> Contacts | None:
    import numpy as np

    from protocol.messages import Contacts

    if not points:
        return None
    count = len(points)
    normal = np.array([point.normal for point in points])
    return Contacts(
        s=np.array([point.at for point in points]),
        body=np.full(count, -1),
        feature=np.full(count, int(Feature.FACE)),
        point=np.array([point.point for point in points]),
        normal=normal / np.linalg.norm(normal, axis=1, keepdims=True),
        direction=np.zeros((count, 3)),
        extent=np.zeros((count, 2)),
        distance=np.array([radius if point.distance is None else point.distance for point in points]),
        friction=np.array([FRICTION_CODES.index(point.friction) for point in points]),
        force=np.zeros((count, 3)),
    )


def _grasps(points: tuple[HeldPoint, ...]) -> Grasps:
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
            assert point.quaternion is not None  # `_mistakes` has seen to it
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
