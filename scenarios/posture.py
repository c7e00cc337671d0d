"""One static posture: a cable, where it is held, what pulls at it and what it touches; the quickest way to ask for a shape.

    title = "a wire between two clamps, with a connector on it, pulled aside"
    margin = true                     # ask for the stability margin too
    [cable]
    name = "wire"
    length = 1.0
    diameter = "6 mm"
    mass_per_length = "17.4 g/m"
    bending = 1.2e-4                  # N m^2
    twist = 1.0e-4
    stretch = "12 kN"
    sections = [{start = 0.2, end = 0.4, bending = 5e-4}]     # taped there
    masses = [{at = 0.5, mass = "8 g"}]
    [[grasps]]
    at = 0
    position = [0, 0, 0]
    tangent = [1, 0, 0]
    [[grasps]]
    at = 1
    position = [0.6, 0, 0]
    tangent = [1, 0, 0]
    [[loads]]
    at = 0.5
    force = [0, "0.1 N", 0]           # in the world frame

How a tangent and a roll become a frame stands in `held_points`. A budget, such as "2 ms", asks for the best shape within that time in
place of the tolerance: what is answered then depends on the machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Final

from annotated_types import Ge, Le, MinLen

from protocol.cable import cable_mistakes, reaches_any_distance
from protocol.errors import MessageError
from protocol.kinds import FRICTION_CODES, RUBS, Feature, Friction, Model
from protocol.scene import STRICT, Cable, Metres, Positive, Unit, Vector

from .document import Document, read_text
from .held_points import HeldPoint, grasps_of
from .lines import key_path
from .quantity import Mistake

if TYPE_CHECKING:
    from protocol.messages import Contacts, PointLoads, ShapeRequest

BUDGET_MAX: Final = 3600.0  # s; one who waits longer for one shape has mistaken the unit


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
class PointLoad:
    """A force on one place of the cable; it does not turn with it."""

    __pydantic_config__: ClassVar = STRICT
    at: Annotated[float, Ge(0), Unit("m")]  # arc length
    force: Annotated[Vector, Unit("N")]  # in the world frame


@dataclass(frozen=True)
class Posture:
    """Everything that one static shape depends on."""

    __pydantic_config__: ClassVar = STRICT
    title: Annotated[str, MinLen(1)]
    cable: Cable
    grasps: Annotated[tuple[HeldPoint, ...], MinLen(1)]
    contacts: tuple[PointContact, ...] = ()
    loads: tuple[PointLoad, ...] = ()
    gravity: Annotated[Vector, Unit("m/s^2")] = (0.0, 0.0, -9.81)
    tolerance: Annotated[Positive, Le(1e3), Unit("m")] = 1e-3
    budget: Annotated[Positive, Le(BUDGET_MAX), Unit("s")] | None = None  # in place of the tolerance
    model: Model = Model.AUTO
    turns: tuple[int, ...] = ()  # whole turns more than the least, from each clamp or guide to the next
    branch: int = 0  # 0: the shape found first; k: the k-th by energy of all stable ones found
    margin: bool = False  # whether the stability margin is wanted too

    def request(self) -> ShapeRequest:
        """The question to the shape server; its grasps are in the order of growing arc length.

        Raises:
            MessageError: If the numbers do not go together; names the field.
        """
        from protocol.messages import Problem, ShapeRequest

        problem = Problem(
            cable=self.cable,
            grasps=grasps_of(self.grasps),
            contacts=_contacts(self.contacts, 0.5 * self.cable.diameter),
            loads=_loads(self.loads),
            model=self.model,
            turns=self.turns,
            branch=self.branch,
        )
        return ShapeRequest(
            session="posture",
            step=0,
            round=0,
            gravity=self.gravity,
            tolerance=self.tolerance,
            problems=(problem,),
            budget=self.budget,
            margin=self.margin,
        )


def load_posture(path: str | Path, overrides: Sequence[str] = ()) -> Posture:
    """The posture in a TOML file, checked.

    Raises:
        SceneError: Holds one sentence for every mistake, each on a line of its own.
    """
    return Document(str(path), read_text(Path(path)), overrides).read(Posture, _mistakes)


def _mistakes(posture: Posture) -> Iterator[Mistake]:
    """All that is wrong once the types are right; what only the request finds comes when there is nothing else."""
    found = [*_of_cable(posture.cable), *_of_places(posture), *_too_far_apart(posture)]
    yield from found or _of_request(posture)


def _of_cable(cable: Cable) -> Iterator[Mistake]:
    if cable.diameter >= cable.length:
        text = f"{cable.diameter:g} m must be smaller than the cable's length, {cable.length:g} m"
        yield Mistake(("cable", "diameter"), text)
    for key, sentence in cable_mistakes(cable):
        yield Mistake(("cable", *key_path(key)), sentence.removeprefix(f"{key}: "))


def _of_places(posture: Posture) -> Iterator[Mistake]:
    """Places beyond the cable, and directions that are none."""
    for index, grasp in enumerate(posture.grasps):
        yield from _beyond(("grasps", index, "at"), grasp.at, posture.cable)
        if (grasp.tangent is None) == (grasp.quaternion is None):
            yield Mistake(("grasps", index), "needs either 'tangent' or 'quaternion', one of the two")
        if grasp.quaternion is not None and grasp.roll:
            yield Mistake(("grasps", index, "roll"), f"{grasp.roll:g} rad goes with 'tangent'; the quaternion holds the roll already")
        for name in ("tangent", "quaternion"):
            yield from _no_direction(("grasps", index, name), getattr(grasp, name))
    for index, contact in enumerate(posture.contacts):
        yield from _beyond(("contacts", index, "at"), contact.at, posture.cable)
        yield from _no_direction(("contacts", index, "normal"), contact.normal)
        if FRICTION_CODES.index(contact.friction) in RUBS:
            text = f"'{contact.friction.value}' depends on how the cable came there, which a posture does not say; there are 'bond', 'none'"
            yield Mistake(("contacts", index, "friction"), text)
    for index, load in enumerate(posture.loads):
        yield from _beyond(("loads", index, "at"), load.at, posture.cable)


def _too_far_apart(posture: Posture) -> Iterator[Mistake]:
    """Held points that are one, or that the cable between them cannot reach; one that stretches or slides in a guide may."""
    held = sorted(range(len(posture.grasps)), key=lambda index: posture.grasps[index].at)
    reaches_further = reaches_any_distance(posture.cable, (grasp.hold for grasp in posture.grasps))
    for first, second in pairwise(held):
        one, two = posture.grasps[first], posture.grasps[second]
        span, chord = two.at - one.at, math.dist(one.position, two.position)
        if span < 1e-6 * posture.cable.length:
            text = f"{two.at:g} m is where grasps[{first}] holds the cable already; hold it at two places"
            yield Mistake(("grasps", second, "at"), text)
        elif chord > span and not reaches_further:
            text = f"is {chord:.4g} m from grasps[{first}], with {span:.4g} m of cable between them; bring it within {span:.4g} m"
            yield Mistake(("grasps", second, "position"), text)


def _of_request(posture: Posture) -> Iterator[Mistake]:
    """What the request refuses; its fields are named as those of the posture are."""
    try:
        posture.request()
    except MessageError as error:
        yield Mistake(key_path(error.key), str(error).removeprefix(f"{error.key}: "))


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


def _loads(loads: tuple[PointLoad, ...]) -> PointLoads | None:
    import numpy as np

    from protocol.messages import PointLoads

    if not loads:
        return None
    return PointLoads(s=np.array([load.at for load in loads]), force=np.array([load.force for load in loads]))
