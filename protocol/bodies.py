"""What a scene may say about bodies, beyond what the types say: as sentences, empty where all is well."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from .kinds import Friction, Inclination, Primitive

if TYPE_CHECKING:
    from .cable import Cable
    from .scene import Body, Target

SIZES: Final = {
    Primitive.SPHERE: ("radius",),
    Primitive.CYLINDER: ("radius", "length"),
    Primitive.CAPSULE: ("radius", "length"),
    Primitive.PLANE: (),
    Primitive.POINT: (),
}


def body_mistake(body: Body) -> str:
    """What is wrong with what a body is made of; empty if nothing is."""
    if sum(given is not None for given in (body.generate, body.mesh, body.shape)) != 1:
        return f"'{body.name}' needs either 'generate', 'mesh' or 'shape', one of the three"
    wanted: tuple[str, ...] = SIZES[body.shape] if body.shape is not None else ()
    for name in ("radius", "length"):
        kind = f"the {body.shape.value} '{body.name}'" if body.shape is not None else f"'{body.name}', which has no 'shape',"
        if name in wanted and getattr(body, name) is None:
            return f"{kind} needs a '{name}' in m"
        if name not in wanted and getattr(body, name) is not None:
            return f"{kind} has no '{name}'; leave it out"
    if body.radius == 0.0 and body.shape is not Primitive.CYLINDER:
        return f"the radius of '{body.name}' must be above 0 m; a point has the shape 'point', and a line is a cylinder of radius 0"
    return ""


def inclination_mistake(body: Body, cables: Sequence[Cable]) -> str:
    """What is wrong with the inclination that a body gives to cables; empty if nothing is."""
    if body.inclination is Inclination.FREE:
        return ""
    if body.friction is not Friction.BOND:
        return f"'fixed' is of cables bonded to '{body.name}'; give it friction = \"bond\""
    limp = [cable.name for cable in cables if cable.bending is None]
    return f"'fixed' needs cables with 'bending' and 'twist'; '{limp[0]}' has none" if limp else ""


def target_mistake(target: Target) -> str:
    """What is wrong with a target of a move, besides names; empty if nothing is."""
    if (target.gripper is None) == (target.body is None):
        return "needs either 'gripper' or 'body', one of the two"
    if target.gripper is not None and target.turn is not None:
        return "'turn' is for a body; turn a gripper by 'tangent' and 'approach'"
    for name in ("clip", "tangent", "approach"):
        if target.body is not None and getattr(target, name) is not None:
            return f"'{name}' is for a gripper; move a body by 'by' or 'to', and turn it by 'turn'"
    if sum(goal is not None for goal in (target.by, target.to, target.clip)) > 1:
        return "give one of 'by', 'to' and 'clip', not several"
    return ""
